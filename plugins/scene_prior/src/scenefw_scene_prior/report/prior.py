"""Drawn scenes beside true ones: tables, distributions, pictures."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scenefw.core.batches import SceneParameters
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.report.blocks import Drawing, Picture, Section
from scenefw.report.figures import COLOURS, INK, STYLE, to_svg
from scenefw.report.measured import column
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import beside, save_picture
from scenefw.report.presentation import Show
from scenefw.report.shading import Solid, draw, turned
from scenefw.report.tables import Cell, Column, Table
from scenefw.representations.volumes import scene_volumes
from scenefw_scene_prior import results
from scenefw_scene_prior.results import GAPS, QUANTITIES, SCORES, PriorResult

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from scenefw.core.measures import Measure
    from scenefw.evaluation.statistics import Interval

_NAMES = {
    results.DRAWN: "drawn without a view",
    results.APART: "drawn without a view, pushed apart",
    results.AT_REST: "drawn without a view, at rest",
    results.GIVEN: "drawn given a view",
    results.TRUTH: "true scenes",
    results.TRAINING: "training scenes",
    results.SHUFFLED: "parts of training scenes, shuffled (no learning)",
    results.SHUFFLED_APART: "shuffled, pushed apart (no learning)",
    results.SHUFFLED_AT_REST: "shuffled, at rest (no learning)",
    results.JITTERED: "true scenes, jittered",
}
_LINES = (results.DRAWN, results.GIVEN, results.TRUTH, results.SHUFFLED)
_PANELS = ("count", "volume", "height", "distance")
_BOUNDED = ("energy", "stable")
_TILE = (280, 210)  # width, height (pixels)
_GRID = GridSpec(resolution=96, truncation_voxels=8.0)
_TURN = 160.0  # degrees: what a camera doesn't see
_EYE = (-0.9, 0.0, 0.6)  # m
_NOTE = (
    "{scenes} scenes of each kind; true ones are of the split {split}. Energy distance between "
    "twelve numbers of each scene, in units of their deviations over training and shuffled "
    "scenes; 0: the same distribution; p: probability of so large a one by chance. Stable: until "
    "everything rests, no centre moves by 20 cm and no object turns by 30°. Nearest: distance of a "
    "scene's objects to those of the nearest training scene; far below that of true scenes it "
    "would be a copy, as training scenes are. Ranges: 95 % bounds. Shuffled: shape and position of "
    "each object from two training scenes. Pushed apart: until objects share nothing. At rest: "
    "pushed apart, then left to gravity; what falls is drawn anew with as many objects, as "
    "`run=draw_scenes` does. Jittered: true "
    "scenes with every object moved by about 1 cm and 5°. Training scenes: what a perfect sampler "
    "of the training set would reach."
)
_QUOTED = frozenset(_NAMES[kind] for kind in (results.TRUTH, results.TRAINING, results.JITTERED))
_GAPS = "Wasserstein's distance of order 1 between a distribution and that of true scenes."


def prior_sections(result: PriorResult, folder: Path) -> tuple[Section, ...]:
    """Tables, distributions, and draws from front and back, written into the folder.

    Raises:
        StorageError: the folder can't be written.
    """
    scenes = len(result.samples[results.TRUTH].stable)
    note = _NOTE.format(scenes=scenes, split=result.split)
    drawing = Drawing(distribution_figure(result), "Shares of scenes, objects or pairs.")
    sections = [
        Section("Drawn scenes beside true ones", (_table(result, "Tests", SCORES, note),)),
        Section(
            "What scenes are made of",
            (
                _means(result),
                _table(result, "Distances of distributions", _gaps(), _GAPS),
                drawing,
            ),
        ),
    ]
    pictures = _pictures(result, folder)
    return (*sections, Section("Draws from front and back", pictures)) if pictures else (*sections,)


def _gaps() -> dict[str, Measure]:
    return {f"{name}_gap": measure for name, measure in GAPS.items()}


def _table(result: PriorResult, title: str, measures: dict[str, Measure], note: str) -> Table:
    """A row for each kind; bounds have a column of their own."""
    bounded = [name for name in measures if name in _BOUNDED]
    columns: list[Column] = []
    for name, measure in measures.items():
        columns += [column(measure), *([Column("95 %")] if name in bounded else [])]
    rows = []
    for kind, scores in result.scores.items():
        cells: list[Cell] = []
        for name, measure in measures.items():
            interval = scores.get(name)
            cells.append(
                None
                if interval is None or np.isnan(interval.mean)
                else measure.shown(interval.mean)
            )
            cells += [_ranged(interval, measure)] if name in bounded else []
        if any(cell is not None for cell in cells):
            rows.append((_NAMES[kind], tuple(cells)))
    return Table(title, tuple(columns), tuple(rows), _QUOTED, note)


def _means(result: PriorResult) -> Table:
    """A row for each kind; bounds stand in the cells."""
    columns = tuple(column(measure, ranked=False) for measure in QUANTITIES.values())
    rows = []
    for kind, scores in result.scores.items():
        cells: list[Cell] = []
        for name, measure in QUANTITIES.items():
            interval = scores[name]
            ends = _ranged(interval, measure)
            text = measure.text(interval.mean) + (f" ({ends})" if ends else "")
            cells.append(None if np.isnan(interval.mean) else text)
        rows.append((_NAMES[kind], tuple(cells)))
    return Table("Means", columns, tuple(rows), _QUOTED, "Means over scenes with 95 % bounds.")


def _ranged(interval: Interval | None, measure: Measure) -> str | None:
    if interval is None or not np.isfinite([interval.low, interval.high]).all():
        return None
    return f"{measure.text(interval.low)} to {measure.text(interval.high)}"


def distribution_figure(result: PriorResult) -> str:
    """Histograms of counts, sizes, heights and distances, a line for each kind (SVG)."""
    kinds = [kind for kind in _LINES if kind in result.samples]
    with rc_context(STYLE):
        figure = Figure(figsize=(11.0, 2.9), layout="constrained")
        for i, name in enumerate(_PANELS):
            measure = QUANTITIES[name]
            unit = f" ({measure.unit})" if measure.unit else ""
            axes = figure.add_subplot(1, len(_PANELS), i + 1, xlabel=measure.heading + unit)
            values = {k: measure.shown(1.0) * result.samples[k].pooled(name) for k in kinds}
            _histogram(axes, values, {"count": "whole", "volume": "log"}.get(name, ""))
        handles = [Line2D([], [], color=COLOURS[i]) for i in range(len(kinds))]
        words = [_NAMES[kind] for kind in kinds]
        figure.legend(handles, words, loc="outside lower center", ncols=len(kinds))
        return to_svg(figure)


def _histogram(axes: Any, values: dict[str, Any], scale: str) -> None:
    all_values = np.concatenate(list(values.values()))
    if not len(all_values):
        return
    low, high = np.quantile(all_values, (0.005, 0.98))
    if scale == "whole":
        edges = np.arange(0.5, max(all_values.max(), 1) + 1)
    elif scale == "log" and 0 < low < high:
        edges = np.geomspace(low, all_values.max(), 21)
        axes.set_xscale("log")
    else:
        edges = np.linspace(low, max(high, low + 1e-6), 21)
    for i, kind_values in enumerate(values.values()):
        counts, _ = np.histogram(kind_values, edges)
        axes.stairs(counts / max(len(kind_values), 1), edges, color=COLOURS[i], linewidth=1.4)
    axes.grid(alpha=0.15, color=INK)


def _pictures(result: PriorResult, folder: Path) -> tuple[Picture, ...]:
    pictures = []
    for kind, scenes in result.examples.items():
        count = len(scenes.present)
        if not count:
            continue
        tiles = _two_rows([(scenes, row) for row in range(count)])
        titles = [f"{_count(scenes, row)} objects" for row in range(count)] + ["behind"] * count
        name = f"prior/{kind}.jpg"
        save_picture(beside(tiles, titles, columns=count), folder / name)
        pictures.append(Picture(name, _NAMES[kind].capitalize()))
    for number, view in enumerate(result.views, start=1):
        draws = range(len(view.draws.present))
        all_scenes = [(view.truth, 0), *((view.draws, row) for row in draws)]
        tiles = _two_rows(all_scenes, view.eye)
        words = ["truth", *(f"draw {row + 1}" for row in draws)]
        titles = [*words, *["behind"] * len(words)]
        name = f"prior/view_{number}.jpg"
        save_picture(beside(tiles, titles, columns=len(words)), folder / name)
        pictures.append(
            Picture(name, f"View {number}: the truth, and draws given what is seen of it")
        )
    return tuple(pictures)


def _two_rows(
    scenes: Sequence[tuple[SceneParameters, int]], eye: Sequence[float] = _EYE
) -> list[Any]:
    """Scenes from the eye, and then all of them from behind."""
    target = np.array([0.0, 0.0, 0.1])
    lens = Camera(*_TILE, 300.0, 300.0, (_TILE[0] - 1) / 2, (_TILE[1] - 1) / 2)
    camera = lens.moved(look_at(np.array(eye, dtype=np.float64), target))
    solids = [_solid(*scene) for scene in scenes]
    return [
        draw(solid, turned(camera, _GRID.centres()[solid.instances > 0], turn))
        for turn in (0.0, _TURN)
        for solid in solids
    ]


def _solid(scenes: SceneParameters, row: int) -> Solid:
    """One scene, its middle above the origin."""
    scene = SceneParameters(*(field[[row]] for field in vars(scenes).values()))
    present = scene.present[0]
    middle = scene.positions[0, present].mean(dim=0) if present.any() else torch.zeros(3)
    shift = middle * torch.tensor([1.0, 1.0, 0.0])
    volumes = scene_volumes(replace(scene, positions=scene.positions - shift), _GRID)
    labels = volumes.instances[0].numpy()
    colours = instance_colours(max(int(labels.max()), 1))
    return Solid(volumes.tsdf[0, 0].numpy(), labels, _GRID, colours)


def _count(scenes: SceneParameters, row: int) -> int:
    return int(scenes.present[row].sum())


SECTIONS: dict[type, Show] = {PriorResult: prior_sections}
