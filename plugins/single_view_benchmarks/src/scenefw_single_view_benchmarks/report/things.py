"""Results on things: tables of masks, shapes, hypotheses, confidence and stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scenefw.evaluation.stacks.methods import described
from scenefw.report import measured
from scenefw.report.blocks import Points, Section
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_single_view_benchmarks import published_shapes
from scenefw_single_view_benchmarks.confidence_results import CONFIDENCE, SCORES
from scenefw_single_view_benchmarks.things_results import (
    DRAWS,
    MASKS,
    METHOD_MASKS,
    RISING,
    SHAPES,
    STANDING,
    TRUE_MASKS,
    TRUTH,
    ThingsResult,
)

if TYPE_CHECKING:
    from scenefw.core.measures import Measure
    from scenefw.report.presentation import Show

_STRATA = {"few": "3 or 4 things", "many": "5 to 16 things", "posed": "Posed things"}
_SENSORS = {
    "kinect": "Kinect",
    "stereo_ramps": "stereo with ramps",
    "time_of_flight": "time of flight",
    "phone_lidar": "phone lidar",
    "none": "no noise",
    "images": "",
}
_ROWS = {RISING: "one object: all that rises", TRUTH: "true scenes"}
_BOUNDED = {
    "overlap_f", "boundary_f", "chamfer", "f_10", "iou", "energy", "stable", "displacement",
}  # fmt: skip


def thing_sections(result: ThingsResult) -> tuple[Section, ...]:
    """What the rows are, a section for each stratum, kinds of things, and figures of others."""
    return (
        Section("What is compared", (Points(tuple(_about(result))),)),
        *(_stratum(result, stratum) for stratum in result.strata),
        Section("By kind of thing", (_kinds(result),)),
        Section("Figures of others", (_others(),)),
    )


def _about(result: ThingsResult) -> list[str]:
    rows = [f"{_row(name)}: {described(name).row}" for name in result.methods]
    scenes = ", ".join(
        f"{len({image.scene for image in result.of(stratum)})} scenes of {_words(stratum)}"
        for stratum in result.strata
    )
    facts = f"{scenes}; ranges are 95 % bootstrap bounds over scenes. {result.about}".strip()
    return [*rows, facts]


def _stratum(result: ThingsResult, stratum: str) -> Section:
    voxel = f"{1000 * result.voxel:g} mm"
    shapes = (
        "Means over objects of a scene, then over scenes. Chamfer: mean distance of points on each "
        "surface to the other surface, the mean of both directions (elsewhere in these pages both "
        "are summed), of matched objects; seen and hidden: of the true surface that the camera "
        f"sees or doesn't. F: of points within 5 or 10 mm. IoU: of voxels of {voxel}. Objects "
        "without a match have F and IoU 0, and no distance. Size: predicted by true volume; size "
        "error: factor by which volumes are off either way. Perfect: 0 mm, 100 %, 1. The rows that "
        "learn nothing are the trivial values."
    )
    masks = (
        "Percent, but count error in objects. Between objects: borders where two masks meet, "
        "pixels added up over images. Trivial: all that rises above the floor is one object."
    )
    draws = (
        f"Of marked objects of the first scenes, {result.draws} hypotheses. Energy score: mean "
        "Chamfer distance to the truth less half of that among hypotheses; who has but one "
        "scores its distance, which is the trivial value. Best: of the whole scene, not of each "
        "object by itself."
    )
    standing = (
        "Of the first scenes, objects as they are found. Stable: under gravity no centre moves by "
        "20 cm or more and nothing turns by 30° or more; moved: mean over objects, at most 20 cm. "
        "Run into others, hover: by more than 5 mm. The true scenes say what the simulation itself "
        "does, a scene of one object that lies flat is the trivial one that stands. Scores of this "
        "kind have been published (Picasso, 2026); its formula was not at hand, so these are ours."
    )
    tables = [
        _table(result, stratum, "masks", "Masks", MASKS, masks),
        _table(result, stratum, METHOD_MASKS, "Shapes, objects as found", SHAPES, shapes),
        _table(result, stratum, TRUE_MASKS, "Shapes, objects marked", SHAPES, ""),
        _table(result, stratum, "draws", "Hypotheses", DRAWS, draws),
        _confidence(result, stratum),
        _table(result, stratum, "standing", "Can the scene stand?", STANDING, standing),
    ]
    refusals = sorted(
        {
            f"{_words(image.sensor)} {image.scene} ({_row(name)}): {reason}"
            for image in result.of(stratum)
            for name, reason in image.refusals.items()
        }
    )
    blocks = [table for table in tables if table.rows]
    notes = dict.fromkeys(note for image in result.of(stratum) for note in image.notes)
    reasons = (Points((*refusals, *notes)),) if refusals or notes else ()
    return Section(_words(stratum), (*blocks, *reasons))


def _table(
    result: ThingsResult,
    stratum: str,
    group: str,
    title: str,
    measures: Mapping[str, Measure],
    note: str,
) -> Table:
    columns: list[Column] = []
    for name, measure in measures.items():
        columns += [measured.column(measure, unit=measure.unit != "%", ranked=False)]
        columns += [Column("95 %")] if name in _BOUNDED else []
    rows = []
    for sensor in [sensor for part, sensor in result.groups if part == stratum]:
        images = result.of(stratum, sensor)
        for method in result.rows(group):
            cells: list[Cell] = []
            for name, measure in measures.items():
                interval = result.interval(images, group, method, name)
                is_there = bool(np.isfinite(interval.mean))
                cells.append(measure.shown(interval.mean) if is_there else None)
                cells += [ranged(interval, measure)] if name in _BOUNDED else []
            if any(isinstance(cell, float) for cell in cells):
                rows.append((_row(method, sensor), tuple(cells)))
    return Table(title, tuple(columns), tuple(rows), note=note)


def _confidence(result: ThingsResult, stratum: str) -> Table:
    """How sure the first method is of its objects."""
    confidence, rows = result.confidence, []
    for sensor in [sensor for part, sensor in result.groups if part == stratum]:
        chosen = confidence.rows_of(f"{stratum}/{sensor}")
        if not chosen.any():
            continue
        iou = confidence.iou[chosen]
        gap, error, rank = (
            confidence.score(CONFIDENCE, name, chosen) for name in ("gap", "error", "rank")
        )
        cells: tuple[Cell, ...] = (
            float(chosen.sum()),
            float(iou.mean()),
            float(confidence.expected[CONFIDENCE][chosen].mean()),
            gap.mean,
            ranged(gap, SCORES["gap"]),
            error.mean,
            float(iou.std()),
            rank.mean if np.isfinite(rank.mean) else None,
        )
        rows.append((_row(result.methods[0], sensor), cells))
    columns = (
        Column("objects", 0), Column("IoU", 3), Column("confidence", 3),
        Column("calibration error", 3), Column("95 %"), Column("error", 3),
        Column("of a constant", 3), Column("rank correlation", 2),
    )  # fmt: skip
    note = (
        "Objects as found and as marked together. Error: root mean square of confidence less IoU; "
        "trivial: the mean IoU as every object's confidence, whose error is that of a constant, "
        "whose calibration error is 0 and whose rank correlation is none."
    )
    return Table("Confidence", columns, tuple(rows), note=note)


def _kinds(result: ThingsResult) -> Table:
    """Marked objects of the main method and of the first reference, by kind."""
    names = ("chamfer", "f_5", "f_10", "iou", "size_ratio")
    methods = (result.methods[0], *result.references[:1])
    by_kind: dict[str, dict[str, list[Mapping[str, float] | None]]] = {}
    for image in result.images:
        for method in methods:
            scores = image.shapes.get(TRUE_MASKS, {}).get(method, ())
            for kind, row in zip(image.kinds, scores, strict=True):
                of_kind = by_kind.setdefault(kind, {name: [] for name in methods})
                of_kind[method].append(row)
    rows = []
    for kind, of_kind in sorted(by_kind.items()):
        cells: list[Cell] = [float(len(of_kind[methods[0]]))]
        for method in methods:
            scores_of_kind = [row for row in of_kind[method] if row is not None]
            for name in names:
                shown = SHAPES[name].shown
                cells.append(shown(_typical(scores_of_kind, name)) if scores_of_kind else None)
        rows.append((kind.split("/")[-1], tuple(cells)))
    columns = [Column("objects", 0)]
    for method in methods:
        for name in names:
            words = f"{_row(method)}: {SHAPES[name].heading}"
            columns.append(Column(words, SHAPES[name].digits))
    note = "Objects marked, images of all sensors and strata together; Chamfer in mm, F in percent."
    return Table("By kind of thing", tuple(columns), tuple(rows), note=note)


def _typical(rows: Sequence[Mapping[str, float]], name: str) -> float:
    values = np.array([row[name] for row in rows])
    if name == "size_ratio":
        return float(np.exp(np.log(np.maximum(values, 1e-9)).mean()))
    return float(values.mean())


def _others() -> Table:
    rows = tuple(
        (row.method, (row.data, SHAPES["chamfer"].shown(row.chamfer)))
        for row in published_shapes.ROWS
    )
    note = (
        "Published, on other images and with a protocol of their own, as summaries quote them; "
        "whether their Chamfer distances are sums or means was not checked."
    )
    names = frozenset(name for name, _ in rows)
    return Table("Published", (Column("data"), Column("Chamfer (mm)", 1)), rows, names, note)


def _row(method: str, sensor: str = "") -> str:
    where = _words(sensor) if sensor else ""
    name = _ROWS.get(method, method.replace("_", " "))
    return f"{where}: {name}" if where else name


def _words(name: str) -> str:
    return {**_STRATA, **_SENSORS}.get(name, name.replace("_", " "))


SECTIONS: dict[type, Show] = {ThingsResult: lambda result, _: thing_sections(result)}
