"""The runs of a sweep as one table, as CSV, and as a plot over what was varied."""

import csv
import io
from pathlib import Path

from scenefw.core.files import write_text
from scenefw.core.measures import Measure
from scenefw.core.protocols import Result
from scenefw.report.blocks import Block, Drawing, Section
from scenefw.report.measured import column
from scenefw.report.presentation import sections_by_class
from scenefw.report.tables import Cell, Table
from scenefw_sweeps.figure import sweep_figure
from scenefw_sweeps.gathered_runs import RunsResult

CSV_FILE = "runs.csv"


class Runs:
    """Shows a row per run and a column per figure, and plots the figures over the settings."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """One section with the table and the plot; `runs.csv` in the folder has the same rows."""
        return sections_by_class(result, folder, {RunsResult: runs_sections})


def runs_sections(result: RunsResult, folder: Path) -> tuple[Section, ...]:
    """One row per run, one column per figure to show, and the plot of them."""
    write_text(folder / CSV_FILE, as_csv(result))
    columns = tuple(column(measure) for measure in result.columns.values())
    rows = tuple(
        (run.name, tuple(_cell(run.figures.get(n), m) for n, m in result.columns.items()))
        for run in result.runs
    )
    note = f"All runs: {' '.join(result.shared)}." if result.shared else ""
    blocks: list[Block] = [Table("Runs side by side", columns, rows, note=note)]
    if len(result.runs) > 1:
        svg, caption = sweep_figure(result)
        blocks.append(Drawing(svg, caption))
    return (Section("Runs", tuple(blocks)),)


def as_csv(result: RunsResult) -> str:
    """A row per run: its name, its settings and its figures, in the units of `metrics.json`."""
    keys = list(dict.fromkeys(key for run in result.runs for key in run.settings))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["run", *keys, *result.columns])
    for run in result.runs:
        settings = [run.settings.get(key, "") for key in keys]
        writer.writerow([run.name, *settings, *(run.figures.get(n, "") for n in result.columns)])
    return text.getvalue()


def _cell(value: float | None, measure: Measure) -> Cell:
    return None if value is None else measure.shown(value)
