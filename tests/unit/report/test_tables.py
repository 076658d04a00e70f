"""One table printed three ways: figures, bold ones, quoted rows, escaping."""

import io
from html.parser import HTMLParser

import pytest
from rich.console import Console
from tests.unit.report.test_html import page_of

from scenefw.report.tables import Column, Table, to_console, to_markdown

TABLE = Table(
    "Chamfer <distance>",
    (Column("visible (m)", 4, "lower"), Column("IoU", 2, "higher"), Column("views", 0)),
    (
        ("ours", (0.0161, 0.5, 30)),
        ("partial | alone", (0.0402, 0.504, 30)),
        ("thesis", (0.0001, None, "4257")),
    ),
    quoted=frozenset({"thesis"}),
    note="means of 10 scenes & 3 views",
)


class _Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.rows, self.open = [], []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag  # well-formed

    def handle_data(self, data):
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += ("*" if "strong" in self.open else "") + data


def test_html_holds_every_figure_and_marks_the_best():
    reader = _Cells()
    page = page_of(TABLE)
    reader.feed(page[page.index("<table") : page.index("</table>") + len("</table>")])
    assert reader.rows == [
        ["", "visible (m) ↓", "IoU ↑", "views"],
        ["ours", "*0.0161", "*0.50", "30"],  # 0.5 and 0.504 print alike: both win
        ["partial | alone", "0.0402", "*0.50", "30"],
        ["thesis", "0.0001", "–", "4257"],  # quoted figures win nothing
    ]
    assert "Chamfer &lt;distance&gt;" in page


def test_markdown_is_a_table_github_reads():
    lines = to_markdown(TABLE).splitlines()
    rows = [line for line in lines if line.startswith("|")]
    assert len(rows) == 5
    assert all(row.replace("\\|", "").count("|") == 5 for row in rows)
    assert rows[2] == "| ours | **0.0161** | **0.50** | 30 |"
    assert lines[-1] == TABLE.note


def test_console_shows_the_same():
    console = Console(file=io.StringIO(), width=120)
    console.print(to_console(TABLE))
    text = console.file.getvalue()
    for word in ("ours", "partial | alone", "0.0402", "4257", "means of 10 scenes & 3 views"):
        assert word in text


def test_nan_is_a_dash_and_one_figure_alone_is_not_best():
    table = Table("t", (Column("a", better="lower"),), (("x", (float("nan"),)), ("y", (1.0,))))
    assert "| x | – |" in to_markdown(table)
    assert "| y | 1.000 |" in to_markdown(table)


def test_ragged_rows_are_refused():
    with pytest.raises(ValueError, match="row x has 2 cells for 1 columns"):
        Table("t", (Column("a"),), (("x", (1.0, 2.0)),))
