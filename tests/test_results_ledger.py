"""The ledger of results says what the pages say, and its table is the one that is published."""

import hashlib
import json
import re

import pytest
from benchmarks import results

from scenefw.core.errors import ConfigError

ASSETS = results.FOLDER.parents[1] / "src" / "scenefw" / "assets"


@pytest.fixture(scope="module")
def ledger():
    return results.read()


@pytest.fixture(scope="module")
def pages(ledger):
    """Text of each page in the ledger."""
    found = {result.page: results.FOLDER / result.page for result in ledger}
    return {name: path.read_text(encoding="utf-8") for name, path in found.items()}


def test_the_published_table_is_the_ledger(ledger):
    text = results.DOCUMENT.read_text(encoding="utf-8")
    assert text == results.document(ledger), "python -m benchmarks.results --write"


def test_every_page_has_a_line(ledger):
    files = {path.name for path in results.FOLDER.glob("*.md")} - {results.DOCUMENT.name}
    assert {result.page for result in ledger} == files


def test_commits_weights_and_commands_stand_in_their_pages(ledger, pages):
    for result in ledger:
        text = pages[result.page]
        assert re.fullmatch(r"[0-9a-f]{10}", result.commit), result.page
        assert f"commit {result.commit}" in text, result.page
        assert re.search(rf"^\s*{re.escape(result.command)}( +#.*)?$", text, re.M), result.page
        top = text.partition("\n## ")[0]
        named = re.findall(r"(\S+)\.safetensors ([0-9a-f]{10})\b", top)
        assert dict(named) == result.weights, result.page


def test_what_is_said_to_ship_ships(ledger):
    shipped = {p.stem: hashlib.sha256(p.read_bytes()) for p in ASSETS.glob("*.safetensors")}
    digits = {name: digest.hexdigest()[:10] for name, digest in shipped.items()}
    for result in ledger:
        others = {name for name, told in result.weights.items() if digits.get(name) != told}
        if result.ships:
            assert not others & digits.keys(), result.page
        else:
            assert others or not result.weights, result.page


def test_splits_are_those_of_commands_and_counts_add_up(ledger):
    for result in ledger:
        given = re.search(r"(?<!\S)split=(\w+)", result.command)
        assert given is None or given[1] == result.split, result.page
        assert result.split in {"val", "test", "all", "none"}, result.page
        if result.together and result.evaluated:
            assert 1 <= result.evaluated < result.together, result.page


def test_rows_say_what_was_counted():
    line = {"page": "a.md", "command": "", "data": "3 views", "split": "test", "ships": True}
    line |= {"weights": {"net": "0123456789", "b": "1"}, "commit": "c"}

    def times(**counts):
        return results.Result(**line, **counts).row()[3]

    assert times(evaluated=2) == "2"
    assert times(evaluated=None) == "–"
    assert times(evaluated=[5, 6]) == "5 and 6"
    assert times(evaluated=2, together=51) == "2 of 51"
    row = results.Result(**line, evaluated=1).row()
    assert row == ["[a](a.md)", "3 views", "test", "1", "net 0123456789, b 1", "c"]


@pytest.mark.parametrize("line", ["{", "[]", json.dumps({"page": "a.md"})])
def test_a_broken_ledger_is_one_line(tmp_path, line):
    (path := tmp_path / "ledger.jsonl").write_text(line)
    with pytest.raises(ConfigError, match=r"ledger\.jsonl can't be read"):
        results.read(path)


FAKE = """
import json, pathlib, sys

words = dict(word.partition("=")[::2] for word in sys.argv[1:])
assert words["input"] == "images" and pathlib.Path("images").is_dir()
output = pathlib.Path(words["paths.output"])
output.mkdir(parents=True)
facts = {"weights": {"net.safetensors": "ab" * 32}, "versions": {"commit": "c0" * 20}}
(output / "run.json").write_text(json.dumps(facts))
pathlib.Path(words["report.publish"]).write_text("# New")
"""


def test_a_page_is_renewed_and_its_looks_are_counted(tmp_path):
    ledger = tmp_path / "docs" / "results" / "ledger.jsonl"
    ledger.parent.mkdir(parents=True)
    (tmp_path / "inputs" / "images").mkdir(parents=True)
    script = tmp_path / "fake.py"
    script.write_text(FAKE)
    shared = {"data": "3 views", "split": "test", "weights": {}, "ships": False, "commit": "c"}
    lines = [
        results.Result("a.md", f"python {script} input=images", evaluated=2, together=5, **shared),
        results.Result("b.md", "python b", evaluated=None, together=5, **shared),
        results.Result("c.md", "python c", evaluated=1, before=("python d",), **shared),
        results.Result("c.md", "python e", evaluated=1, **shared),
    ]
    results.write(lines, ledger)
    assert results.read(ledger)[1] == lines[1]
    results.renew("a", tmp_path / "inputs", ledger)
    first, second, third, _ = results.read(ledger)
    assert (first.evaluated, first.together, second.together) == (3, 6, 6)
    assert (first.weights, first.commit) == ({"net": "ab" * 5}, "c0" * 5)
    assert first.ships
    assert second.evaluated is None
    assert third.before == ["python d"]
    assert (ledger.parent / "a.md").read_text() == "# New"
    for page in ("c", "none"):
        with pytest.raises(ConfigError, match="can be renewed"):
            results.renew(page, tmp_path, ledger)
