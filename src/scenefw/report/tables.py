"""A table of figures, for the console (rich) and as Markdown; `html.py` makes it HTML."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from rich.table import Table as ConsoleTable

Cell = str | float | None
"""Text, a figure, or None where there is none to print."""


@dataclass(frozen=True)
class Column:
    """Heading of a column of figures.

    Args:
        name: what stands above it.
        digits: decimals of its figures.
        better: which figure is printed bold: the lowest, the highest, or none.
    """

    name: str
    digits: int = 3
    better: Literal["lower", "higher"] | None = None

    @property
    def heading(self) -> str:
        """The name with an arrow for the better direction."""
        return self.name + {"lower": " ↓", "higher": " ↑", None: ""}[self.better]


@dataclass(frozen=True)
class Table:
    """Rows of figures, each row with a name.

    Args:
        title: one line.
        columns: of the figures.
        rows: (name, cells); as many cells as columns.
        quoted: names of rows printed for comparison from elsewhere; they win no bold figure.
        note: what the figures are means of, how many, from which seeds.
    """

    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[str, tuple[Cell, ...]], ...]
    quoted: frozenset[str] = frozenset()
    note: str = ""

    def __post_init__(self) -> None:
        for name, cells in self.rows:
            if len(cells) != len(self.columns):
                raise ValueError(
                    f"row {name} has {len(cells)} cells for {len(self.columns)} columns"
                )


def to_console(table: Table) -> ConsoleTable:
    """The table for `rich.print`; the note is its caption."""
    from rich.table import Table as ConsoleTable
    from rich.text import Text

    console_table = ConsoleTable(
        title=table.title, caption=table.note or None, title_justify="left"
    )
    console_table.add_column("")
    for column in table.columns:
        console_table.add_column(column.heading, justify="right")
    for name, cells in printed(table):
        style = "dim" if name in table.quoted else ""
        texts = [Text(text, style="bold" if best else "") for text, best in cells]
        console_table.add_row(Text(name), *texts, style=style)
    return console_table


def to_markdown(table: Table) -> str:
    """The table in GitHub's Markdown, with its title and note."""
    lines = [f"**{table.title}**", ""]
    lines.append("| | " + " | ".join(_escape(c.heading) for c in table.columns) + " |")
    lines.append("| --- |" + " ---: |" * len(table.columns))
    for name, cells in printed(table):
        texts = [f"**{_escape(text)}**" if best else _escape(text) for text, best in cells]
        lines.append(f"| {_escape(name)} | " + " | ".join(texts) + " |")
    return "\n".join([*lines, "", table.note]).rstrip() + "\n"


def printed(table: Table) -> list[tuple[str, list[tuple[str, bool]]]]:
    """Every row's name and its cells as text, with whether they are the column's best."""
    best = [_best(table, i) for i in range(len(table.columns))]
    printed = []
    for name, cells in table.rows:
        texts = [_text(cell, column) for cell, column in zip(cells, table.columns, strict=True)]
        wins = [name not in table.quoted and text == best[i] for i, text in enumerate(texts)]
        printed.append((name, list(zip(texts, wins, strict=True))))
    return printed


def _best(table: Table, index: int) -> str | None:
    """The best figure of a column as printed (ties in print are all bold); None if it is alone."""
    column = table.columns[index]
    column_cells = [cells[index] for name, cells in table.rows if name not in table.quoted]
    figures = [
        cell for cell in column_cells if isinstance(cell, int | float) and math.isfinite(cell)
    ]
    if column.better is None or len(figures) < 2:
        return None
    return _text(min(figures) if column.better == "lower" else max(figures), column)


def _text(cell: Cell, column: Column) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    return cell if isinstance(cell, str) else f"{cell:.{column.digits}f}"


def _escape(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
