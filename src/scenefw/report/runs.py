"""The runs of a sweep as one table."""

from scenefw.evaluation.gathered_runs import Run, RunsResult, ShownFigure
from scenefw.report.blocks import Section
from scenefw.report.tables import Cell, Column, Table


def runs_sections(result: RunsResult) -> tuple[Section, ...]:
    """One row per run, one column per figure that is to be shown."""
    columns = tuple(Column(c.heading, c.digits, c.better) for c in result.columns)  # type: ignore[arg-type]
    rows = tuple((run.name, tuple(_cell(run, c) for c in result.columns)) for run in result.runs)
    note = f"All runs: {' '.join(result.shared)}." if result.shared else ""
    return (Section("Runs", (Table("Runs side by side", columns, rows, note=note),)),)


def _cell(run: Run, column: ShownFigure) -> Cell:
    value = run.figures.get(column.figure)
    return None if value is None else value * column.factor
