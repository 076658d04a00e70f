"""The README's table: our figures beside those without learning and published ones."""

from collections.abc import Sequence

from scenefw.core.errors import InputError
from scenefw.report.stored import StoredRun
from scenefw.report.tables import Table, to_markdown
from scenefw.report.weights.summary import COLUMNS, Part, Row, Summary, parts_in


def headline(runs: Sequence[StoredRun], summaries: Sequence[Summary]) -> str:
    """One table of all runs in Markdown, and the commands that found its figures.

    Args:
        runs: one per summary at most.
        summaries: in the order of the table.

    Raises:
        InputError: there is no run, one has other figures, or two have the same.
    """
    if not runs:
        raise InputError("no results to show; give run.results=[FOLDER,...] of run=evaluate")
    found = [part for run in runs for part in parts_in(run, summaries)]
    shown = [part for summary in summaries for part in _only(found, summary)]
    rows: list[Row] = []
    for part in shown:
        rows.append((f"**{part.title}**", ("",) * len(COLUMNS)))
        rows += part.rows(details=False)
    table = Table("Figures of the weights that ship", COLUMNS, tuple(rows))
    notes = [f"*{part.summary.name}.* {part.summary.note}\n" for part in shown]
    commands = dict.fromkeys(part.run.origin for part in shown)
    return "\n".join([to_markdown(table), *notes, "```", *commands, "```"])


def _only(parts: Sequence[Part], summary: Summary) -> list[Part]:
    """The part of a summary, if there is one."""
    found = [part for part in parts if part.summary is summary]
    if len(found) > 1:
        first, second = (part.run.path for part in found[:2])
        raise InputError(f"{first} and {second} hold the same figures")
    return found
