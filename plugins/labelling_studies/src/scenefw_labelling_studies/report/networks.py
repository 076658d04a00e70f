"""The two networks on single views and on maps (table 4.1)."""

from __future__ import annotations

import numpy as np

from scenefw.report.blocks import Section
from scenefw.report.measured import column
from scenefw.report.presentation import Show
from scenefw.report.tables import Cell, Table
from scenefw_labelling_studies import published
from scenefw_labelling_studies.networks import MAPS, VIEWS, NetworksResult


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


SECTIONS: dict[type, Show] = {NetworksResult: lambda result, _: network_sections(result)}
