"""What the result of an evaluation looks like on the page: tables, figures, words."""

from functools import singledispatch
from typing import Any

import numpy as np

from scenefw.evaluation.real_masks import PUBLISHED, RealMaskResult
from scenefw.report.blocks import Section, Text
from scenefw.report.tables import Column, Table

_MASKS = {
    "overlap_f": Column("overlap F", 1, "higher"),
    "overlap_precision": Column("P", 1),
    "overlap_recall": Column("R", 1),
    "boundary_f": Column("boundary F", 1, "higher"),
    "boundary_precision": Column("P", 1),
    "boundary_recall": Column("R", 1),
    "objects_f75": Column("objects F ≥ 75", 1, "higher"),
    "count_error": Column("count error", 2, "lower"),
}


@singledispatch
def sections(result: Any) -> tuple[Section, ...]:
    """The sections of any result that has `figures`; kinds of results have registered their own."""
    rows = tuple((name, (float(value),)) for name, value in result.figures.items())
    return (Section("Results", (Table("Figures", (Column("value", 4),), rows),)),)


@sections.register
def _(result: RealMaskResult) -> tuple[Section, ...]:
    figures = result.figures
    rows = (
        ("scenefw", _mask_cells(figures)),
        ("floor removed, components cut at depth jumps", _mask_cells(figures, "reference/")),
        ("UOIS-Net-3D, depth only, whole data set (published)", _mask_cells(PUBLISHED)),
    )
    missing = f"; {len(result.failures)} more could not be used" if result.failures else ""
    note = (
        f"Percent, means over {len(result.images)} images{missing}; count error in objects per "
        "image. P precision, R recall. The published row is of the whole Object Segmentation "
        "Database, its harder images included."
    )
    table = Table(
        "Instances on real images", tuple(_MASKS.values()), rows, frozenset({rows[2][0]}), note
    )
    worst = tuple(Text(f"{name}: {reason}") for name, reason in result.failures)
    return (Section("Labelled real images", (table, _per_image(result), *worst)),)


def _mask_cells(figures: dict[str, float], prefix: str = "") -> tuple[float | None, ...]:
    scale = {name: 1.0 if name == "count_error" else 100.0 for name in _MASKS}
    found = {name: figures.get(prefix + name) for name in _MASKS}
    return tuple(None if v is None else scale[name] * v for name, v in found.items())


def _per_image(result: RealMaskResult) -> Table:
    """How the images are spread: best, quartiles, worst of both methods."""
    columns = tuple(
        Column(f"{name} {what}", 1)
        for name in ("scenefw", "reference")
        for what in ("overlap F", "boundary F")
    )
    ours = [(i.scores.overlap_f, i.scores.boundary_f) for i in result.images]
    theirs = [(i.reference.overlap_f, i.reference.boundary_f) for i in result.images]
    values = 100 * np.concatenate([ours, theirs], axis=1)
    quartiles = np.percentile(values, [100, 75, 50, 25, 0], axis=0)
    names = ("best", "upper quarter", "median", "lower quarter", "worst")
    rows = tuple((n, tuple(map(float, q))) for n, q in zip(names, quartiles, strict=True))
    return Table(
        "Spread over images", columns, rows, note="Percent; every column sorted on its own."
    )
