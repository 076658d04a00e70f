"""Figures in tables of prose are those of the pages that they name."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = re.compile(r"\(\[page\]\((\S+)\)\) \|(.*)\|")
METHODS = (
    "superquadrics fitted to a network's parts, hidden parts by a flow of sets",
    "superquadrics fitted to parts of the image (no learning)",
)


@pytest.mark.parametrize("document", ["README.md", "docs/reasoning.md"])
def test_rows_of_the_first_hypothesis_are_those_of_their_pages(document):
    path = ROOT / document
    rows = PAGE.findall(path.read_text(encoding="utf-8"))
    assert len(rows) == 6
    for page, told in rows:
        lines = (path.parent / page).read_text(encoding="utf-8").splitlines()
        for method, pair in zip(METHODS, told.split("|"), strict=True):
            row = next(line for line in lines if line.startswith(f"| {method} |"))
            cells = [cell.strip(" *") for cell in row.split("|")]
            assert [cells[4], cells[6]] == pair.replace(" ", "").split("/"), (page, method)


def test_figures_of_cluttered_tables_are_those_of_their_page():
    told = re.search(
        r"cluttered tables\]\((\S+)\).*?boundary F are (\S+) and (\S+), without learning (\S+) and "
        r"(\S+)\.",
        (ROOT / "README.md").read_text(encoding="utf-8"),
    )
    page, *figures = told.groups()
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
    for method, pair in (("scenefw", figures[:2]), ("floor removed", figures[2:])):
        row = next(line for line in lines if line.startswith(f"| {method}"))
        cells = [cell.strip(" *") for cell in row.split("|")]
        assert [cells[2], cells[5]] == pair, method
