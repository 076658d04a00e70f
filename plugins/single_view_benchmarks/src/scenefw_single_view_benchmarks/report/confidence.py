"""Confidences beside what they should have been, as tables."""

from __future__ import annotations

import numpy as np

from scenefw.report import measured
from scenefw.report.blocks import Section, Text
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_single_view_benchmarks.confidence_results import (
    AGREEMENT,
    CONFIDENCE,
    CONSTANT,
    FITTED,
    SCORES,
    ConfidenceResult,
    equal_groups,
)

_WAYS = {
    AGREEMENT: "agreement of hypotheses",
    CONFIDENCE: "confidence of run=predict",
    FITTED: "fitted to the other half of the scenes",
    CONSTANT: "mean IoU of the other half (no learning)",
}


def confidence_sections(result: ConfidenceResult) -> tuple[Section, ...]:
    """Scores of each way to a confidence, of each family of images, and the IoU by confidence."""
    if not result.objects:
        return (Section("Confidence", (Text("No object was predicted."),)),)
    blocks = [_scores(result)] if result.rows_of().any() else []
    return (Section("Confidence", (*blocks, _families(result), _groups(result), _fit(result))),)


def _scores(result: ConfidenceResult) -> Table:
    columns = [c for measure in SCORES.values() for c in (measured.column(measure), Column("95 %"))]
    rows, chosen = [], result.rows_of()
    for way in result.expected:
        cells: list[Cell] = []
        for name, measure in SCORES.items():
            interval = result.score(way, name, chosen)
            cells += [measure.shown(interval.mean), ranged(interval, measure)]
        rows.append((_WAYS[way], tuple(cells)))
    note = (
        f"{chosen.sum()} objects of {len(np.unique(result.images[chosen]))} images, "
        f"{result.samples} samples, each image predicted by itself and with its objects marked. "
        "Expected is the IoU of the solid with the true one that is most alike; skill: 0 % is the "
        "constant, 100 % no error. Ranges: 95 % bootstrap bounds over images, of calibration "
        "errors and rank correlations over objects."
    )
    return Table("Expected and true IoU", tuple(columns), tuple(rows), note=note)


def _families(result: ConfidenceResult) -> Table:
    rows = []
    for family in result.families:
        chosen = result.rows_of(family)
        cells: list[Cell] = [float(chosen.sum()), float(result.iou[chosen].mean())]
        for way in (AGREEMENT, CONFIDENCE):
            rank = result.score(way, "rank", chosen)
            cells += [float(result.expected[way][chosen].mean()), SCORES["rank"].shown(rank.mean)]
            cells.append(ranged(rank, SCORES["rank"]))
        gap = result.score(CONFIDENCE, "gap", chosen)
        cells += [SCORES["gap"].shown(gap.mean), ranged(gap, SCORES["gap"])]
        name = family.replace("_", " ")
        rows.append(
            (f"{name} (nothing fitted)" if family in result.validation else name, tuple(cells))
        )
    columns = (
        Column("objects", 0), Column("IoU", 2), Column("agreement", 2), Column("rank", 2),
        Column("95 %"), Column("confidence", 2), Column("rank", 2), Column("95 %"),
        Column("calibration error", 3), Column("95 %"),
    )  # fmt: skip
    return Table("By family of images", columns, tuple(rows))


def _groups(result: ConfidenceResult) -> Table:
    """Groups of equal size by confidence."""
    confidence, rows = result.expected[CONFIDENCE], []
    for group in equal_groups(confidence):
        cells: list[Cell] = [float(len(group)), float(confidence[group].mean())]
        cells += [float(result.iou[group].mean()), float((result.iou[group] > 0.5).mean())]
        low, high = confidence[group].min(), confidence[group].max()
        rows.append((f"{low:.2f} to {high:.2f}", tuple(cells)))
    columns = (
        Column("objects", 0), Column("confidence", 2), Column("IoU", 2), Column("IoU > 0.5", 2),
    )  # fmt: skip
    return Table("By confidence, all families", columns, tuple(rows))


def _fit(result: ConfidenceResult) -> Text:
    fitted = result.fitted
    if fitted is None:
        return Text("")
    weights = ", ".join(
        f"{name} {weight:+.2f}" for name, weight in zip(fitted.names, fitted.weights, strict=True)
    )
    return Text(
        "Fitted to all of them but validation families: by one standard deviation, the logit of "
        f"the expected IoU changes by {weights}."
    )


SECTIONS: dict[type, Show] = {ConfidenceResult: lambda result, _: confidence_sections(result)}
