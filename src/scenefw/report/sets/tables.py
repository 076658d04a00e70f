"""Table of decompositions, with the thesis's row."""

from collections.abc import Sequence

from scenefw.evaluation.sets.measures import SCORES
from scenefw.evaluation.sets.published import ROWS
from scenefw.evaluation.sets.results import DecompositionResult
from scenefw.report.measured import column
from scenefw.report.sets.names import called
from scenefw.report.tables import Cell, Table

_NOTE = (
    "Means over {scenes} test scenes, {objects:.1f} objects each. Missing: no prediction has an "
    "IoU of 0.25 with the object. Joined: a prediction covers half of each of two objects. "
    "Duplicate: a second prediction has an IoU of 0.25 with an object. Split: an object in which "
    "two predictions lie has no prediction with an IoU of 0.5."
)
_METHODS = {
    "set_network": "the one that this experiment trains",
    "set_extents": "fitted hulls, hidden extents sampled by a network",
    "fitted_parts": "the scene's distances rendered from all sides, superquadrics fitted to parts "
    "of all images between creases (no learning)",
    "network_parts": "as fitted parts, with parts that a network finds",
    "fitted_hulls": "superquadrics in parts of the image (no learning)",
    "components": "connected parts of the true occupancy (no learning)",
    "nothing": "an empty set, the trivial value of each measure",
}
_SEEN = (
    "Of the same scenes. In {hardly_seen:.0%} of them an object is hidden but for a few pixels, or "
    "wholly; the others are those that one view shows."
)
_PUBLISHED = (
    " Thesis: {words}, {n} scenes; it doesn't define its errors, nor what its BCE is a mean over."
)


_ERRORS = (
    "missing",
    "missing_seen",
    "joined",
    "duplicate",
    "split",
    "count_excess",
    "occupancy_iou",
)


def decomposition_tables(result: DecompositionResult) -> tuple[Table, Table]:
    """A row per method and that of the thesis; then single errors."""
    figures = result.figures
    names = [name for name in SCORES if name not in _ERRORS]
    note = _NOTE.format(scenes=int(figures["scenes"]), objects=figures["objects"])
    note += "".join(
        f" {called(method).capitalize()}: {_METHODS[method]}."
        for method in result.methods
        if method in _METHODS
    )
    rows, quoted = _rows(result, names), frozenset[str]()
    if result.published:
        row = ROWS[result.published]
        words = f"thesis, table {row.table} (published)"
        values = row._asdict()
        rows = (*rows, (words, tuple(_cell(name, values.get(name)) for name in names)))
        quoted = frozenset({words})
        note += _PUBLISHED.format(words=row.words, n=row.scenes)
    columns = tuple(column(SCORES[name]) for name in names)
    single = tuple(column(SCORES[name]) for name in _ERRORS)
    return (
        Table("Decomposition into objects", columns, rows, quoted, note),
        Table("Single errors", single, _rows(result, _ERRORS), note=_SEEN.format(**figures)),
    )


def _rows(
    result: DecompositionResult, names: Sequence[str]
) -> tuple[tuple[str, tuple[Cell, ...]], ...]:
    figures = result.figures
    prefixes = {m: "" if m == result.methods[0] else f"{m}/" for m in result.methods}
    return tuple(
        (
            called(method),
            tuple(_cell(name, figures.get(prefix + name)) for name in names),
        )
        for method, prefix in prefixes.items()
    )


def _cell(name: str, value: float | None) -> float | None:
    return None if value is None else SCORES[name].shown(value)
