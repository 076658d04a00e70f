"""Figures in tables of prose are those of the pages that they name."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = re.compile(r"\(\[page\]\((\S+)\)\) \|(.*)\|")
IMAGES = (
    "traced through 64³ voxels",
    "traced through 128³ voxels",
    "exact shapes",
    "exact shapes, noise of a Kinect",
    "exact shapes, noise of a stereo camera",
    "exact shapes, noise of a stereo camera that blurs edges",
)
METHODS = (
    "superquadrics fitted to a network's parts, hidden parts by a flow of sets",
    "superquadrics fitted to parts of the image (no learning)",
)


def test_rows_of_the_first_hypothesis_are_those_of_their_pages():
    path = ROOT / "docs" / "reasoning.md"
    rows = PAGE.findall(path.read_text(encoding="utf-8"))
    for images, (page, told) in zip(IMAGES, rows, strict=True):
        lines = (path.parent / page).read_text(encoding="utf-8").splitlines()
        for method, pair in zip(METHODS, told.split("|"), strict=True):
            row = next(line for line in lines if line.startswith(f"| {images} | {method} |"))
            cells = [cell.strip(" *") for cell in row.split("|")]
            assert [cells[6], cells[8]] == pair.replace(" ", "").split("/"), (page, method)


def test_sentences_of_the_readme_are_those_of_their_pages():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    sentences = re.findall(r"\[(0\.\d+) with [^]]+\]\((\S+)\) \((?:no learning: )?(0\.\d+)\)", text)
    assert len(sentences) == 2
    for images, (figure, page, reference) in zip(IMAGES[3::2], sentences, strict=True):
        lines = (ROOT / page).read_text(encoding="utf-8").splitlines()
        for method, value in zip(METHODS, (figure, reference), strict=True):
            row = next(line for line in lines if line.startswith(f"| {images} | {method} |"))
            assert row.split("|")[6].strip(" *") == value, (page, method)


HOUSEHOLD = {  # overlap and boundary F of the method, then of the rule
    "Kinect": r"F are (\S+) and (\S+) against (\S+) and (\S+) of a rule",
    "stereo with ramps": r"stereo camera they are (\S+) and (\S+) against (\S+) and (\S+),",
    "time of flight": r"-flight camera (\S+) and (\S+) against (\S+) and (\S+)\.",
}


def test_figures_of_household_things_are_those_of_their_page():
    text = (ROOT / "README.md").read_text(encoding="utf-8").replace("\n", " ")
    page = re.search(r"\[household things\]\((\S+?)\)", text).group(1)
    lines = (ROOT / page).read_text(encoding="utf-8").splitlines()

    def cells(sensor, method, table):
        rows = [line for line in lines if line.startswith(f"| {sensor}: {method} |")]
        return [cell.strip(" *") for cell in rows[table].split("|")]

    for sensor, sentence in HOUSEHOLD.items():
        figures = re.search(sentence, text).groups()
        for method, pair in (("set extents", figures[:2]), ("hull", figures[2:])):
            row = cells(sensor, method, 0)
            assert (row[2], row[4]) == pair, (sensor, method)
    ours, hulls = re.search(r"with a Kinect (\S+) mm against (\S+) of hulls", text).groups()
    assert (cells("Kinect", "set extents", 1)[3], cells("Kinect", "hull", 1)[3]) == (ours, hulls)


def test_figures_of_labelled_images_are_those_of_their_page():
    """Of the commit that the README names for them."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    page = (ROOT / "docs" / "results" / "osd.md").read_text(encoding="utf-8")
    rows = [
        [
            cell.strip(" *")
            for cell in next(
                line for line in page.splitlines() if line.startswith(f"| {method} |")
            ).split("|")
        ]
        for method in ("set extents", "floor removed, cut at jumps and creases of depth")
    ]
    columns = {"overlap F (%) ↑": 2, "boundary F (%) ↑": 5, "objects too many or too few ↓": 12}
    for name, column in columns.items():
        row = next(line for line in text.splitlines() if line.startswith(f"| {name} |"))
        cells = [cell.strip(" *") for cell in row.split("|")]
        assert cells[2:4] == [method[column] for method in rows], name
    (commit,) = re.findall(r"experiment=osd .*?# commit (\w+)", text)
    assert f"commit {commit}" in page
