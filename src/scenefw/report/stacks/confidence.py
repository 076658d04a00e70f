"""Confidences beside what they should have been, as tables."""

from __future__ import annotations

import numpy as np

from scenefw.evaluation.stacks.confidence_results import (
    CONSTANT,
    FITTED,
    SAID,
    SCORES,
    SHIPPED,
    ConfidenceResult,
)
from scenefw.report import measured
from scenefw.report.blocks import Section, Text
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table

_WAYS = {
    SAID: "agreement as it is",
    SHIPPED: "calibrated as by run=predict",
    FITTED: "calibrated on the other half of the scenes",
    CONSTANT: "mean IoU of the other half (no learning)",
}
_BINS = 8
_LEAST = 10  # objects of a bin


def confidence_sections(result: ConfidenceResult) -> tuple[Section, ...]:
    """Scores of each way to a confidence, and the IoU of objects by agreement."""
    if not result.objects:
        return (Section("Confidence", (Text("No object was predicted."),)),)
    return (Section("Confidence", (_scores(result), _reliability(result), _knots(result))),)


def _scores(result: ConfidenceResult) -> Table:
    columns = [c for measure in SCORES.values() for c in (measured.column(measure), Column("95 %"))]
    rows = []
    for way in result.expected:
        cells: list[Cell] = []
        for name, measure in SCORES.items():
            interval = result.score(way, name)
            cells += [measure.shown(interval.mean), ranged(interval, measure)]
        rows.append((_WAYS[way], tuple(cells)))
    figures = result.figures
    rank = f", rank correlation with the IoU {figures['rank']:.2f}" if "rank" in figures else ""
    note = (
        f"{len(result.objects)} objects of {figures['scenes']:.0f} scenes, one view each, "
        f"{result.samples} samples. Agreement: mean IoU with the other samples{rank}. Expected is "
        "the IoU with the true object that is most alike; skill: 0 % is the constant, 100 % no "
        "error. Ranges: 95 % bootstrap bounds over scenes."
    )
    return Table("Expected and true IoU", tuple(columns), tuple(rows), note=note)


def _reliability(result: ConfidenceResult) -> Table:
    """Groups of equal size by agreement."""
    order = result.agreement.argsort(kind="stable")
    groups = np.array_split(order, max(min(_BINS, len(order) // _LEAST), 1))
    rows = []
    for group in groups:
        low, high = result.agreement[group].min(), result.agreement[group].max()
        cells: list[Cell] = [float(len(group)), float(result.agreement[group].mean())]
        cells += [float(result.iou[group].mean()), float((result.iou[group] > 0.5).mean())]
        rows.append((f"{low:.2f} to {high:.2f}", tuple(cells)))
    columns = (
        Column("objects", 0), Column("agreement", 2), Column("IoU", 2), Column("IoU > 0.5", 2),
    )  # fmt: skip
    return Table("By agreement", columns, tuple(rows))


def _knots(result: ConfidenceResult) -> Text:
    fitted = result.fitted
    if fitted is None:
        return Text("")
    agreements = ", ".join(f"{value:.3f}" for value in fitted.said)
    expected = ", ".join(f"{value:.3f}" for value in fitted.expected)
    return Text(f"Fitted to all of them: said [{agreements}], expected [{expected}].")


SECTIONS: dict[type, Show] = {ConfidenceResult: lambda result, _: confidence_sections(result)}
