"""How stable piles are, as a table, and by visibility."""

from __future__ import annotations

from scenefw.evaluation.stacks.results import VISIBILITY_EDGES
from scenefw.report import measured
from scenefw.report.blocks import Drawing, Section
from scenefw.report.figures import bin_figure
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_single_view_benchmarks.stability_results import SCORES, TRUTH, StabilityResult

_NAMES = {
    TRUTH: "true scenes",
    "drawn": "predictions, drawn codes",
    "typical": "predictions, zero code",
    "set_extents": "superquadrics fitted to a network's parts, hidden extents sampled by a network",
    "fitted": "predictions, superquadrics fitted to the view",
    "fitted_hulls": "superquadrics fitted to parts of the image (no learning)",
}
_THESIS = "SIMstack (thesis)"
_RANGED = ("displacement", "displacement_median", "stable")
_BY_VISIBILITY = {
    "displacement": "Displacement, mean (cm)",
    "stable": "Stable piles (%)",
}


def stability_sections(result: StabilityResult) -> tuple[Section, ...]:
    """A row for each kind of scenes, and figures 5.26 and 5.27."""
    panels = {
        title: {_name(method): _binned(result, method, name) for method in result.methods}
        for name, title in _BY_VISIBILITY.items()
    }
    drawing = bin_figure(VISIBILITY_EDGES, panels, "visible share of the true surface")
    return (
        Section("Piles under gravity", (stability_table(result),)),
        Section("By visibility", (Drawing(drawing),)),
    )


def stability_table(result: StabilityResult) -> Table:
    """Displacements and shares of stable piles with bounds."""
    columns: list[Column] = []
    for name, measure in SCORES.items():
        columns += [measured.column(measure), *([Column("95 %")] if name in _RANGED else [])]
    rows = [(_name(method), _cells(result, method)) for method in result.methods]
    published = result.measures.get("drawn/displacement")
    if published and published.published is not None:
        empty: tuple[Cell, ...] = (None,) * (len(columns) - 1)
        rows.append((_THESIS, (published.shown(published.published), *empty)))
    note = (
        f"{len(result.views)} views of {len({view.scene for view in result.views})} test scenes, "
        f"{result.steps} steps each. Displacement: of the objects of a pile on average. Stable: no "
        f"centre moves by {100 * result.furthest:g} cm or more, no object turns by "
        f"{result.steepest:g}° or more. Ranges: 95 % bootstrap bounds over scenes."
    )
    quoted = frozenset({_name(TRUTH), _THESIS})
    return Table("Piles under gravity", tuple(columns), tuple(rows), quoted, note)


def _cells(result: StabilityResult, method: str) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    for name, measure in SCORES.items():
        interval = result.interval(method, name)
        cells.append(measure.shown(interval.mean))
        cells += [ranged(interval, measure)] if name in _RANGED else []
    return tuple(cells)


def _binned(result: StabilityResult, method: str, name: str) -> tuple[float | None, ...]:
    convert = SCORES[name].shown
    values = result.by_visibility(method, name)
    return tuple(None if value is None else convert(value) for value in values)


def _name(method: str) -> str:
    return _NAMES.get(method, method.replace("_", " "))


SECTIONS: dict[type, Show] = {StabilityResult: lambda result, _: stability_sections(result)}
