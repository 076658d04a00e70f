"""The runs of a sweep as one table."""

from pathlib import Path

from scenefw.core.measures import Measure
from scenefw.core.protocols import Result
from scenefw.evaluation.gathered_runs import RunsResult
from scenefw.report.blocks import Section
from scenefw.report.measured import column
from scenefw.report.presentation import sections_by_class
from scenefw.report.tables import Cell, Table


class Runs:
    """Shows a row per run and a column per figure."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """One section with the table."""
        return sections_by_class(result, folder, {RunsResult: lambda runs, _: runs_sections(runs)})


def runs_sections(result: RunsResult) -> tuple[Section, ...]:
    """One row per run, one column per figure to show."""
    columns = tuple(column(measure) for measure in result.columns.values())
    rows = tuple(
        (run.name, tuple(_cell(run.figures.get(n), m) for n, m in result.columns.items()))
        for run in result.runs
    )
    note = f"All runs: {' '.join(result.shared)}." if result.shared else ""
    return (Section("Runs", (Table("Runs side by side", columns, rows, note=note),)),)


def _cell(value: float | None, measure: Measure) -> Cell:
    return None if value is None else measure.shown(value)
