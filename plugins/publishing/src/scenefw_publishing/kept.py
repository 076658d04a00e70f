"""Parts of an earlier table of figures, for evaluations that were not run again."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from scenefw_publishing.summary import Summary

_FENCE = "```"
_WEIGHTS = re.compile(r"([\w-]+\.safetensors) ([0-9a-f]{10})")


@dataclass(frozen=True)
class KeptPart:
    """One part of a table as it stands in a document.

    Args:
        summary: what it sums up.
        rows: lines of the table, the title first.
        note: its line below the table.
        commands: that found its figures; all of the table where it can't be told which.
    """

    summary: Summary
    rows: tuple[str, ...]
    note: str
    commands: tuple[str, ...]


def kept_parts(text: str, summaries: Sequence[Summary]) -> list[KeptPart]:
    """The parts that an earlier table has, in its order; none of what is no such table.

    Args:
        text: the table, its notes and its commands, as `headline` wrote them.
        summaries: that may be in it.
    """
    lines = text.splitlines()
    titles = [(i, match) for i, line in enumerate(lines) if (match := _titled(line, summaries))]
    commands = _commands(lines)
    command_groups = [(command,) for command in commands] if len(commands) == len(titles) else None
    parts = []
    for number, (start, summary) in enumerate(titles):
        rows = [lines[start]]
        for line in lines[start + 1 :]:
            if not line.startswith("|") or line.startswith("| **"):
                break
            rows.append(line)
        note = next((line for line in lines if line.startswith(f"*{summary.name}.* ")), "")
        parts.append(
            KeptPart(
                summary, tuple(rows), note, command_groups[number] if command_groups else commands
            )
        )
    return parts


def require_known(parts: Sequence[KeptPart], digests: Collection[str]) -> None:
    """Checks that kept figures are of these weights.

    Args:
        parts: of an earlier table.
        digests: SHA-256 of the weights that ship.

    Raises:
        InputError: a command names others.
    """
    for part in parts:
        for name, beginning in _WEIGHTS.findall("\n".join(part.commands)):
            if not any(digest.startswith(beginning) for digest in digests):
                raise InputError(
                    f"the figures of {part.summary.name!r} in the table are of another {name} than "
                    "the one that ships; give a new evaluation too: run.results=[FOLDER,...]"
                )


def _titled(line: str, summaries: Sequence[Summary]) -> Summary | None:
    """The summary whose title stands in a row."""
    for summary in summaries:
        pieces = re.split(r"\{[^}]*\}", summary.title)
        title = "[^|]+".join(re.escape(piece) for piece in pieces)
        if re.match(rf"\| \*\*{title}\*\* \|", line):
            return summary
    return None


def _commands(lines: Sequence[str]) -> tuple[str, ...]:
    """The lines of the block of code."""
    ends = [i for i, line in enumerate(lines) if line == _FENCE]
    return tuple(lines[ends[0] + 1 : ends[1]]) if len(ends) == 2 else ()
