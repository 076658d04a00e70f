"""Errors against the number of views: tables with bounds, curves, figures as CSV."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from scenefw.core.files import write_text
from scenefw.evaluation.stacks.methods import described
from scenefw.report.blocks import Drawing, Section
from scenefw.report.figures import bin_figure
from scenefw.report.presentation import Show
from scenefw.report.stacks.draws import ranged
from scenefw.report.tables import Cell, Column, Table
from scenefw_several_views.results import SCORES, SeveralViewsResult

if TYPE_CHECKING:
    from pathlib import Path

_PANELS = ("excess", "occupancy_iou", "instance_iou")
CSV_FILE = "several_views.csv"
"""In the folder of the page: a row per method, number of views and score."""


def several_views_sections(result: SeveralViewsResult, folder: Path) -> tuple[Section, ...]:
    """Figure 5.35 with bounds: curves, and a table per score; also writes them as CSV."""
    write_text(folder / CSV_FILE, as_csv(result))
    edges = [result.counts[0] - 0.5, *(count + 0.5 for count in result.counts)]
    panels = {
        SCORES[name].heading + (f" ({SCORES[name].unit})" if SCORES[name].unit else ""): {
            described(method).row: [
                SCORES[name].shown(result.interval(method, count, name).mean)
                for count in result.counts
            ]
            for method in result.methods
        }
        for name in _PANELS
    }
    caption = "Excess: dense Chamfer distance over that of the truth, drawn twice."
    return (
        Section("By the number of views", (Drawing(bin_figure(edges, panels, "views"), caption),)),
        Section("Tables", tuple(score_table(result, name) for name in SCORES)),
    )


def score_table(result: SeveralViewsResult, name: str) -> Table:
    """A row per method, two columns per number of views: the mean and its bounds."""
    measure = SCORES[name]
    columns: list[Column] = []
    for count in result.counts:
        heading = f"{count} view" + "s" * (count > 1)
        columns += [Column(heading, measure.digits, measure.better), Column("95 %")]
    rows = [(described(m).row, _cells(result, m, name)) for m in result.methods]
    unit = f" ({measure.unit})" if measure.unit else ""
    note = (
        f"Means over {len(result.scenes)} scenes, at most {result.samples} samples each. Ranges: "
        "95 % bootstrap bounds over scenes."
    )
    if name == "chamfer_full":
        note += f" No method falls below {measure.text(result.floor)} mm, the truth drawn twice."
    return Table(f"{measure.name or measure.heading}{unit}", tuple(columns), tuple(rows), note=note)


def as_csv(result: SeveralViewsResult) -> str:
    """Columns method, views, score, mean, low, high, scenes, in metres where it is a distance."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["method", "views", "score", "mean", "low", "high", "scenes"])
    for method in result.methods:
        for count in result.counts:
            for name in SCORES:
                interval = result.interval(method, count, name)
                bounds = [f"{value:.6g}" for value in (interval.mean, interval.low, interval.high)]
                writer.writerow([method, count, name, *bounds, interval.count])
    return text.getvalue()


def _cells(result: SeveralViewsResult, method: str, name: str) -> tuple[Cell, ...]:
    cells: list[Cell] = []
    for count in result.counts:
        interval = result.interval(method, count, name)
        cells += [SCORES[name].shown(interval.mean), ranged(interval, SCORES[name])]
    return tuple(cells)


SECTIONS: dict[type, Show] = {SeveralViewsResult: several_views_sections}
