"""Results of labelling: tables beside the thesis's, curves, noise maps and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, astuple
from pathlib import Path

import numpy as np

from scenefw.evaluation.labelling import published
from scenefw.evaluation.labelling.curves import CurvesResult
from scenefw.evaluation.labelling.measures import SCORES
from scenefw.evaluation.labelling.networks import MAPS, VIEWS, NetworksResult
from scenefw.evaluation.labelling.noise import SCORES_FILE, NoiseResult
from scenefw.evaluation.labelling.pool_weights import WeightsResult
from scenefw.evaluation.labelling.results import HYBRID, Scores, write_scores
from scenefw.evaluation.labelling.shared_parts import STAGES
from scenefw.evaluation.labelling.times import TimesResult
from scenefw.evaluation.statistics import Interval
from scenefw.report.blocks import Block, Drawing, Picture, Section, Text
from scenefw.report.labelling.figures import Panel, bounds_figure, noise_figure
from scenefw.report.labelling.pictures import example_picture
from scenefw.report.measured import column
from scenefw.report.pictures import save_picture
from scenefw.report.presentation import Show
from scenefw.report.tables import Cell, Column, Table

DEFINITION = (
    "Mean IoU: of each scene the mean over the classes that its truth holds, each counting the "
    "same, over all vertices of the orthographic ground truth; a vertex that is unseen or has no "
    "label yet counts as missed. `over seen` leaves unseen vertices out. Then mean over scenes, "
    "with Student's t bounds of 95 %."
)


def curves_sections(result: CurvesResult, folder: Path) -> tuple[Section, ...]:
    """Figures 4.23 and 4.24 and the pictures of figure 4.21; writes scores and pictures."""
    write_scores(folder / "curves.csv", result.scores)
    scores = result.scores
    parts = [
        Section(
            "Labels against frames and time",
            (
                Drawing(_curves(scores), _caption(scores)),
                _final(scores),
                _by_frames(scores),
                *_advantage(scores),
                Text(DEFINITION),
            ),
        ),
        Section("Classes, heights, times", (_classes(result), _heights(scores), _stages(result))),
    ]
    if result.example is not None:
        path = "pictures/labelling.png"
        save_picture(
            example_picture(result.example, result.classes, scores.strategies), folder / path
        )
        caption = f"First test scene after {_listed(result.example.frames)} frames"
        parts.append(Section("Maps", (Picture(path, caption),)))
    return tuple(parts)


def noise_sections(result: NoiseResult, folder: Path) -> tuple[Section, ...]:
    """Figures 4.25 and 4.26; writes the scores."""
    write_scores(folder / SCORES_FILE, result.scores)
    count = len(result.scores.scenes)
    maps = {name: result.grid(name) for name in result.strategies}
    caption = (
        f"Mean IoU after {_listed(result.scores.counts)} frames under Gaussian noise of camera "
        f"poses and of depth, mean over {count} scenes"
    )
    blocks: list[Block] = [Drawing(noise_figure(maps, result.pose, result.depth), caption)]
    blocks += _single_noises(result)
    blocks += [_noise_table(result), Text(DEFINITION)]
    return (Section("Labels under noise", tuple(blocks)),)


def network_sections(result: NetworksResult) -> tuple[Section, ...]:
    """Table 4.1."""
    figures = result.figures
    keys = ("miou", "weighted_iou", *result.classes)
    columns = tuple(
        column(result.measures[f"{VIEWS}/{key}"], ranked=key != "weighted_iou") for key in keys
    )
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    for name in result.counts:
        cells = tuple(figures.get(f"{name}/{key}") for key in keys)
        learnt = "" if name in (VIEWS, MAPS) else ", maps, no learning"
        rows.append((f"{name}{learnt} ({result.number[name]})", cells))
    quoted = []
    for name in (VIEWS, MAPS):
        by_class = dict(zip(published.CLASSES, published.CLASS_IOU[name], strict=True))
        mean = float(np.mean(published.CLASS_IOU[name]))
        row = (mean, published.PRINTED_MEAN[name], *(by_class.get(c) for c in result.classes))
        quoted.append((f"thesis, {name}", row))
    note = (
        f"IoU over all pixels of the test views, and over all seen vertices of test maps fused "
        f"from {result.frames} frames. The thesis prints 0.95 and 0.93 as mean IoU; its own "
        "figures per class average to the class means given here, so the printed ones stand under "
        "frequency-weighted."
    )
    table = Table(
        "Networks on single views and on maps (table 4.1)",
        columns,
        (*rows, *quoted),
        frozenset(name for name, _ in quoted),
        note,
    )
    return (Section("Networks", (table,)),)


def times_sections(result: TimesResult) -> tuple[Section, ...]:
    """Table 4.2."""
    stages = [s for s in STAGES if any(s in times for times in result.milliseconds.values())]
    columns = (*(Column(f"{stage} (ms)", 2) for stage in stages), Column("per frame (ms)", 2))
    rows: list[tuple[str, tuple[Cell, ...]]] = [
        (name, (*(times.get(stage) for stage in stages), result.per_frame[name]))
        for name, times in result.milliseconds.items()
    ]
    rows.append(("thesis", (*(published.MILLISECONDS.get(stage) for stage in stages), None)))
    memory = ", ".join(f"{name} {value:.0f} MB" for name, value in result.memory.items())
    note = (
        f"Means over {result.scenes} scenes of {result.frames} frames on {result.device}; networks "
        "per pass, the other stages per frame. Per frame: all processing divided by the number of "
        f"frames, the map labelled once. The thesis: one GPU, 27 scenes, 1000 frames. Peak memory, "
        f"of all that this run has done so far: {memory}."
    )
    table = Table(
        "Time of each stage (table 4.2)", columns, tuple(rows), frozenset({"thesis"}), note
    )
    return (Section("Time and memory", (table,)),)


def weights_sections(result: WeightsResult) -> tuple[Section, ...]:
    """The hybrid's weights, ready for its config."""
    pools = result.pool.parts
    names = tuple(asdict(result.pool.surface))
    rows = tuple((part, astuple(weights)) for part, weights in pools.items())
    note = (
        f"From {result.vertices} vertices of {result.scenes} scenes, each class counting the same."
    )
    table = Table("Weights of the pool", tuple(Column(n, 4) for n in names), rows, note=note)
    accuracy = Table(
        "Share of these vertices labelled right",
        (Column("mean over classes", 4, "higher"),),
        tuple((name, (value,)) for name, value in result.accuracy.items()),
    )
    values = {
        f"{part}.{name}": value
        for part, weights in pools.items()
        for name, value in asdict(weights).items()
    } | {"doubt": result.pool.doubt}
    overrides = " ".join(f"labelling.{HYBRID}.pool.{k}={v:.4g}" for k, v in values.items())
    return (Section("Weights of the hybrid", (table, accuracy, Text(overrides))),)


def _curves(scores: Scores) -> str:
    levels = {f"thesis, {name}": interval.mean for name, interval in published.FINAL.items()}
    by_frames = {name: (scores.counts, scores.curve(name, "miou")) for name in scores.strategies}
    by_time = {
        name: ([p.mean for p in scores.curve(name, "seconds")], scores.curve(name, "miou"))
        for name in scores.strategies
    }
    panels = (
        Panel("against frames", "frames", by_frames, levels),
        Panel("against processing time", "seconds", by_time, levels),
    )
    return bounds_figure(panels, "mean IoU")


def _caption(scores: Scores) -> str:
    return (
        f"Mean over {len(scores.scenes)} test scenes with 95 % bounds; dotted: the thesis after "
        f"{published.FRAMES} frames of {published.SCENES} scenes of its own, models of ShapeNet"
    )


def _final(scores: Scores) -> Table:
    columns = (
        column(SCORES["miou"]),
        Column("95 % bounds"),
        column(SCORES["miou_seen"], ranked=False),
    )
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    for name in scores.strategies:
        miou, observed_miou = scores.final(name), scores.final(name, "miou_seen")
        rows.append((name, (miou.mean, _bounds(miou), observed_miou.mean)))
    quoted = [
        (f"thesis, {name}", (interval.mean, _bounds(interval), None))
        for name, interval in published.FINAL.items()
    ]
    title = f"Mean IoU after {scores.counts[-1]} frames, {len(scores.scenes)} scenes"
    note = "The thesis's scenes are others, with models of ShapeNet."
    return Table(title, columns, (*rows, *quoted), frozenset(name for name, _ in quoted), note)


def _by_frames(scores: Scores) -> Table:
    columns = (
        *(Column(name, 3) for name in scores.strategies),
        *(Column(f"{name}, over seen", 3) for name in scores.strategies),
        column(SCORES["coverage"], ranked=False),
    )
    curves = [scores.curve(n, m) for m in ("miou", "miou_seen") for n in scores.strategies]
    curves.append(scores.curve(scores.strategies[0], "coverage"))
    rows = tuple(
        (f"{frames} frames", tuple(curve[i].mean for curve in curves))
        for i, frames in enumerate(scores.counts)
    )
    return Table("Mean IoU by number of frames", columns, rows)


def _advantage(scores: Scores) -> tuple[Table, ...]:
    """How much better the hybrid is, scene by scene."""
    competitors = [name for name in scores.strategies if name != HYBRID]
    if HYBRID not in scores.strategies or not competitors:
        return ()
    columns = tuple(
        column for name in competitors for column in (Column(f"− {name}", 4), Column("95 % bounds"))
    )
    gains = {name: scores.advantage(HYBRID, name) for name in competitors}
    rows = tuple(
        (
            f"{frames} frames",
            tuple(c for n in competitors for c in (gains[n][i].mean, _bounds(gains[n][i], 4))),
        )
        for i, frames in enumerate(scores.counts)
    )
    note = "Mean IoU of the hybrid minus that of another strategy on the same scene and frames."
    return (Table("The hybrid against the others, paired", columns, rows, note=note),)


def _classes(result: CurvesResult) -> Table:
    columns = tuple(Column(name, 3, "higher") for name in result.classes)
    rows = tuple(
        (name, tuple(None if np.isnan(v) else float(v) for v in ious))
        for name, ious in result.class_iou.items()
    )
    note = "Over the vertices of all scenes together."
    return Table("IoU by class after all frames", columns, rows, note=note)


def _heights(scores: Scores) -> Table:
    columns = (Column("RMS (mm)", 3), Column("median (mm)", 3), Column("coverage", 3))
    name = scores.strategies[0]
    curves = [scores.curve(name, m) for m in ("height_rms", "height_median", "coverage")]
    rows = tuple(
        (
            f"{frames} frames",
            tuple(s * c[i].mean for s, c in zip((1e3, 1e3, 1), curves, strict=True)),
        )
        for i, frames in enumerate(scores.counts)
    )
    note = "Errors of seen heights against the truth; the map is the same for all strategies."
    return Table("Heights", columns, rows, note=note)


def _stages(result: CurvesResult) -> Table:
    stages = [s for s in STAGES if any(s in times for times in result.seconds.values())]
    columns = tuple(Column(f"{stage} (s)", 2) for stage in stages)
    rows = tuple(
        (name, tuple(times.get(stage) for stage in stages))
        for name, times in result.seconds.items()
    )
    note = "Per scene, all frames; the map is labelled once, when it is read."
    return Table("Time of each stage", columns, rows, note=note)


def _single_noises(result: NoiseResult) -> list[Block]:
    """Curves over one noise at the lowest amount of the other (figure 4.25)."""
    least_pose, least_depth = result.pose[0], result.depth[0]
    pose = {
        n: ([1e3 * p for p in result.pose], [result.cell(n, p, least_depth) for p in result.pose])
        for n in result.strategies
    }
    depth = {
        n: ([1e3 * d for d in result.depth], [result.cell(n, least_pose, d) for d in result.depth])
        for n in result.strategies
    }
    panels = (
        Panel("pose noise", "standard deviation (mm)", pose, {}),
        Panel("depth noise", "standard deviation (mm)", depth, {}),
    )
    count = len(result.scores.scenes)
    caption = f"One noise alone, with 95 % bounds over {count} scenes (figure 4.25)"
    return [Drawing(bounds_figure(panels, "mean IoU"), caption)]


def _noise_table(result: NoiseResult) -> Table:
    first, competitors = result.strategies[0], [n for n in result.strategies if n != HYBRID]
    compared = HYBRID in result.strategies and bool(competitors)
    columns = (
        *(Column(name, 3, None) for name in result.strategies),
        *([Column(f"{HYBRID} − best of the others", 3, None)] if compared else []),
        *([Column("paired 95 %", 3, None)] if compared else []),
        column(SCORES["height_rms"], ranked=False),
    )
    rows = []
    for p in result.pose:
        for d in result.depth:
            means = {name: result.cell(name, p, d).mean for name in result.strategies}
            cells: list[Cell] = list(means.values())
            if compared:
                best = max(competitors, key=means.__getitem__)
                gain = result.difference(HYBRID, best, p, d)
                cells += [gain.mean, _bounds(gain)]
            cells.append(SCORES["height_rms"].shown(result.cell(first, p, d, "height_rms").mean))
            rows.append((f"pose {1000 * p:g} mm, depth {1000 * d:g} mm", tuple(cells)))
    return Table("Mean IoU under noise (figure 4.26)", columns, tuple(rows))


def _bounds(interval: Interval, digits: int = 3) -> str:
    if np.isnan(interval.low):
        return "–"
    return f"({interval.low:.{digits}f}, {interval.high:.{digits}f})"


def _listed(numbers: Sequence[int]) -> str:
    words = [str(number) for number in numbers]
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))


SECTIONS: dict[type, Show] = {
    CurvesResult: curves_sections,
    NoiseResult: noise_sections,
    NetworksResult: lambda result, _: network_sections(result),
    TimesResult: lambda result, _: times_sections(result),
    WeightsResult: lambda result, _: weights_sections(result),
}
