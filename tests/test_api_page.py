"""Every example of docs/api.md and every cell of the notebook runs, and shows what stands there."""

import doctest
import json
import re
import warnings
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "api.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```pycon\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


@pytest.mark.exhaustive
def test_examples_show_what_the_page_says(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    examples = [
        example for block in BLOCKS for example in doctest.DocTestParser().get_examples(block)
    ]
    assert len(examples) > 15
    page = doctest.DocTest(examples, {}, "docs/api.md", "docs/api.md", 0, PAGE)
    said = []
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
        runner.run(page, out=said.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(said)
    files = {path.name for path in tmp_path.iterdir()}
    assert files == {"changed", "map.npz", "scene.glb", "scene.xml", "blocks.ply", "drawn"}


@pytest.mark.exhaustive
def test_the_notebook_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    notebook = json.loads((DOCS / "first_image.ipynb").read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert len(cells) >= 5
    names = {}
    for number, cell in enumerate(cells):
        exec(compile(cell, f"cell {number} of first_image.ipynb", "exec"), names)
    assert len(names["scene"].objects) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["scene.glb", "scene.json"]
    assert not any(cell.get("outputs") for cell in notebook["cells"])
