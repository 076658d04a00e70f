"""Results on simulated stacks: table 5.1 beside the thesis's, instances, by visibility."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from scenefw.evaluation.stacks import published
from scenefw.evaluation.stacks.measures import DRAWS
from scenefw.evaluation.stacks.methods import BASE_RATE, TRAINING_MEAN, described
from scenefw.evaluation.stacks.results import VISIBILITY_EDGES, ReconstructionResult
from scenefw.report import measured
from scenefw.report.blocks import Drawing, Section, Text
from scenefw.report.figures import bin_figure
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import draw_sections, ranged, skills
from scenefw.report.tables import Cell, Column, Table

_AS_THESIS = ("chamfer_visible", "chamfer_full", "occupancy_bce")
_SURFACE = (
    "chamfer_visible_excess",
    "chamfer_full_excess",
    "chamfer_full_dense",
    "fscore_1cm",
    "normal_consistency",
    "occupancy_iou",
    "hidden_coverage",
)
_INSTANCES = (
    "instance_iou",
    "panoptic_quality",
    "instance_recall",
    "count_error",
    "count_excess",
)
_BY_VISIBILITY = {  # with the titles of its panels
    "chamfer_full_excess": "Chamfer full, excess (mm)",
    "occupancy_iou": "Occupancy IoU",
    "instance_iou": "Instance IoU",
}


def reconstruction_sections(result: ReconstructionResult) -> tuple[Section, ...]:
    """Table 5.1, the surfaces judged by their excess, instances, and all of it by visibility."""
    blind = (Text(_BCE_WORDS),) if BASE_RATE in result.methods else ()
    beside = (as_thesis(result), *blind, Text(_FLOOR_WORDS), _surfaces(result))
    sample_sections = draw_sections(result.draws) if result.draws else ()
    return (
        Section("What it is worth", (headline(result),)),
        Section("Beside the thesis", beside),
        Section("Instances", (_instances(result), *_by_pixels(result))),
        *sample_sections,
        Section("By visibility", _by_visibility(result)),
    )


_BCE_WORDS = (
    "The cross entropy of expected occupancy, as the thesis measures it, is no measure of skill: "
    "forecasts that don't look at the image, the two rows of it, beat methods that do. Hard "
    "occupancies of a few samples are forecasts of 0 or 1. Each wrong one costs 100 nats, where "
    "logs are cut off: the figure counts voxels on which all samples are wrong alike."
)
_FLOOR_WORDS = (
    "A Chamfer distance between two random samplings of one and the same surface is not zero. "
    "This floor, measured on the true surfaces, is the least that any method can get with 1000 "
    "points, and most of the figures above; what counts is the excess over it. Dense figures are "
    "from 30 000 points."
)


_HEADLINE = ("chamfer_full_excess", "instance_iou", "panoptic_quality")
_SKILLS = ("log_skill", "brier_skill")


def headline(result: ReconstructionResult) -> Table:
    """What counts, with bounds: surfaces, instances, and probabilities of occupied space."""
    measures = {name: result.measures[name] for name in _HEADLINE}
    skills_of = skills(result.draws)
    all_measures = {**measures, **({name: DRAWS[name] for name in _SKILLS} if skills_of else {})}
    columns = [
        c for measure in all_measures.values() for c in (measured.column(measure), Column("95 %"))
    ]
    rows = []
    for method in result.methods:
        cells: list[Cell] = []
        for name, measure in all_measures.items():
            is_available = name in _SKILLS or name in result.names(method)
            skill = skills_of.get(method, {}).get(name) if name in _SKILLS else None
            interval = result.interval(method, name) if is_available and name in measures else skill
            cells += (
                [measure.shown(interval.mean), ranged(interval, measure)]
                if interval
                else [None, None]
            )
        if any(cell is not None for cell in cells):
            rows.append((described(method).row, tuple(cells)))
    return Table(
        "Skill beside methods without learning",
        tuple(columns),
        tuple(rows),
        note=_headline_note(result),
    )


def _headline_note(result: ReconstructionResult) -> str:
    words = f"{sizes(result)} Ranges: 95 % bootstrap bounds over scenes."
    if result.draws and result.draws.views:
        words += (
            f" Skills, of {result.draws.count} draws of each of {len(result.draws.views)} views: "
            "0 % is the training mean of each voxel, 100 % the truth."
        )
    return words


def as_thesis(result: ReconstructionResult) -> Table:
    """Means and sigmas of the figures of table 5.1, the thesis's rows last."""
    columns = [
        column
        for measure in (result.measures[name] for name in _AS_THESIS)
        for column in (measured.column(measure), Column("σ", measure.digits + 1))
    ]
    rows = [
        (described(method).row, _means_and_sigmas(result, method, _AS_THESIS))
        for method in result.methods
        if "occupancy_bce" in result.names(method)
    ]
    floors = [f"{name}_floor" for name in _AS_THESIS]
    rows.append(
        ("floor: truth sampled twice", _means_and_sigmas(result, result.methods[0], floors))
    )
    reference = published.published_of(result.published)
    theirs = [(f"{name} (thesis)", _published(f)) for name, f in reference.figures.items()]
    quoted = frozenset({"floor: truth sampled twice", *(name for name, _ in theirs)})
    quoted |= {described(name).row for name in (BASE_RATE, TRAINING_MEAN)}
    thesis = (
        f" Thesis: {reference.scenes} scenes, {published.VIEWS} views of each." if theirs else ""
    )
    note = f"{sizes(result)} σ is over views.{thesis}"
    return Table("As in table 5.1", tuple(columns), tuple(rows + theirs), quoted, note)


def sizes(result: ReconstructionResult) -> str:
    """One line: of how many scenes, views and samples, with which seed."""
    samples = "1 sample" if result.samples == 1 else f"{result.samples} samples"
    return (
        f"Means over {len(result.views)} views of {result.scenes} test scenes, {samples} "
        f"per view, seed {result.seed}; {result.visibility.mean():.0%} of the true surface "
        "is visible on average."
    )


def _means_and_sigmas(
    result: ReconstructionResult, method: str, names: Sequence[str]
) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    for name in names:
        is_available = name in result.names(method)
        summary = result.summary(method, name) if is_available else None
        cells += [summary.mean, summary.sigma] if summary else [None, None]
    return tuple(cells)


def _published(figures: Mapping[str, published.Figure]) -> tuple[Cell, ...]:
    values = [figures.get(name) for name in _AS_THESIS]
    return tuple(cell for f in values for cell in ((f.mean, f.sigma) if f else (None, None)))


def _surfaces(result: ReconstructionResult) -> Table:
    note = (
        "Chamfer: both directions summed; excess is over the floor. F at 1 cm: of points within 1 "
        "cm of the other surface; normals: mean cosine at nearest points; hidden in spread: share "
        "of hidden voxels whose true distance lies between those of the samples."
    )
    return _table(result, "Surfaces and volumes", _SURFACE, note)


def _instances(result: ReconstructionResult) -> Table:
    note = (
        "IoU of true objects with their matched predictions (0 where none), averaged over objects; "
        "found: share of true objects with IoU > 0.5; count error: objects too many or too few."
    )
    return _table(result, "Instances after matching", _INSTANCES, f"{sizes(result)} {note}")


def _by_pixels(result: ReconstructionResult) -> tuple[Table, ...]:
    """Objects by how much of them the image shows: which a method can find at all."""
    bins = result.by_pixels()
    if not bins:
        return ()
    columns = tuple(Column(_pixels(group.low, group.high), 2) for group in bins)
    total = sum(group.count for group in bins)
    rows: list[tuple[str, tuple[Cell, ...]]] = []
    for method in bins[0].recall:
        name = described(method).row
        rows.append((f"{name}: found", tuple(group.recall[method] for group in bins)))
        rows.append((f"{name}: IoU", tuple(group.iou[method] for group in bins)))
    share = "share of all objects (%)"
    rows.append((share, tuple(f"{100 * group.count / total:.1f}" for group in bins)))
    note = (
        f"{total} objects, by how many pixels of the image show them; IoU is the mean over "
        "samples. An object that no pixel shows can be guessed, not found."
    )
    return (
        Table(
            "Objects by the pixels that show them", columns, tuple(rows), frozenset({share}), note
        ),
    )


def _pixels(low: float, high: float) -> str:
    if high <= 1:
        return "none"
    return f"{low:,.0f} or more" if np.isinf(high) else f"{low:,.0f} to {high - 1:,.0f}"


def _table(result: ReconstructionResult, title: str, names: Sequence[str], note: str) -> Table:
    measures = {name: result.measures[name] for name in names}
    rows = []
    for method in result.methods:
        available_names = result.names(method)
        cells = [
            measure.shown(result.summary(method, name).mean) if name in available_names else None
            for name, measure in measures.items()
        ]
        if any(cell is not None for cell in cells):
            rows.append((described(method).row, tuple(cells)))
    return Table(title, tuple(map(measured.column, measures.values())), tuple(rows), note=note)


def _by_visibility(result: ReconstructionResult) -> tuple[Drawing | Table, ...]:
    """One drawing of all figures, then a table of each."""
    panels = {
        title: {
            described(method).row: _binned(result, method, name)
            for method in result.methods
            if name in result.names(method)
        }
        for name, title in _BY_VISIBILITY.items()
    }
    digits = [result.measures[name].digits for name in _BY_VISIBILITY]
    tables = [
        _bins_table(result, title, lines, count)
        for (title, lines), count in zip(panels.items(), digits, strict=True)
    ]
    label = "visible share of the true surface"
    return (Drawing(bin_figure(VISIBILITY_EDGES, panels, label)), *tables)


def _binned(result: ReconstructionResult, method: str, name: str) -> tuple[float | None, ...]:
    means = {low: s.mean for low, _, s in result.by_visibility(method, name)}
    convert = result.measures[name].shown
    return tuple(convert(means[low]) if low in means else None for low in VISIBILITY_EDGES[:-1])


def _bins_table(
    result: ReconstructionResult,
    title: str,
    lines: Mapping[str, tuple[float | None, ...]],
    digits: int,
) -> Table:
    edges = list(pairwise(VISIBILITY_EDGES))
    counts = [int(((result.visibility >= a) & (result.visibility < b)).sum()) for a, b in edges]
    indices = [i for i, count in enumerate(counts) if count]
    columns = tuple(Column(f"{edges[i][0]:.0%}–{edges[i][1]:.0%}", digits) for i in indices)
    rows: list[tuple[str, tuple[Cell, ...]]] = [
        (name, tuple(values[i] for i in indices)) for name, values in lines.items()
    ]
    rows.append(("views", tuple(str(counts[i]) for i in indices)))
    return Table(title, columns, tuple(rows), frozenset({"views"}))


SECTIONS: dict[type, Show] = {
    ReconstructionResult: lambda result, _: reconstruction_sections(result)
}
