"""The README's table: our figures beside those without learning and published ones."""

from collections.abc import Sequence

from scenefw.core.errors import InputError
from scenefw.report.tables import Table, to_markdown
from scenefw_publishing.kept import KeptPart
from scenefw_publishing.stored import StoredRun
from scenefw_publishing.summary import COLUMNS, Part, Row, Summary, parts_in


def headline(
    runs: Sequence[StoredRun], summaries: Sequence[Summary], earlier_parts: Sequence[KeptPart] = ()
) -> str:
    """One table of all runs in Markdown, and the commands that found its figures.

    Args:
        runs: one per summary at most.
        summaries: in the order of the table.
        earlier_parts: parts of an earlier table; they stay where no run has figures.

    Raises:
        InputError: there is no run, one has other figures, or two have the same.
    """
    if not runs:
        raise InputError("no results to show; give run.results=[FOLDER,...] of run=evaluate")
    parts = [part for run in runs for part in parts_in(run, summaries)]
    blocks = []
    for summary in summaries:
        new = [_block(part) for part in _only(parts, summary)]
        blocks += new or [part for part in earlier_parts if part.summary is summary]
    table = to_markdown(Table("Figures of the weights that ship", COLUMNS, ()))
    rows = [row for block in blocks for row in block.rows]
    notes = [f"{block.note}\n" for block in blocks]
    commands = dict.fromkeys(line for block in blocks for line in block.commands)
    return "\n".join([table.rstrip("\n"), *rows, "", *notes, "```", *commands, "```"])


def _block(part: Part) -> KeptPart:
    """A part as lines of Markdown."""
    title: Row = (f"**{part.title}**", ("",) * len(COLUMNS))
    table = Table("", COLUMNS, (title, *part.rows(details=False)))
    lines = [line for line in to_markdown(table).splitlines() if line.startswith("|")]
    note = f"*{part.summary.name}.* {part.summary.note}"
    return KeptPart(part.summary, tuple(lines[2:]), note, (part.run.origin,))


def _only(parts: Sequence[Part], summary: Summary) -> list[Part]:
    """The part of a summary, if there is one."""
    matches = [part for part in parts if part.summary is summary]
    if len(matches) > 1:
        first, second = (part.run.path for part in matches[:2])
        raise InputError(f"{first} and {second} hold the same figures")
    return matches
