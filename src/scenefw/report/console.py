"""Bars and tables in the terminal."""

from collections.abc import Iterable, Sequence
from typing import TypeVar

from scenefw.report.blocks import Section
from scenefw.report.tables import Table, to_console

Item = TypeVar("Item")


def track(items: Sequence[Item], description: str) -> Iterable[Item]:
    """The items, with a progress bar that shows rate and time left."""
    from rich.progress import track as bar

    return bar(items, description)


def print_tables(sections: Sequence[Section]) -> None:
    """Prints the tables of sections to the console."""
    from rich.console import Console

    console = Console()
    if not console.is_terminal:  # cuts nothing when the output is not a terminal
        console = Console(width=160)
    for section in sections:
        for block in section.blocks:
            if isinstance(block, Table):
                console.print(to_console(block))
