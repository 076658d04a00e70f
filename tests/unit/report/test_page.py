"""The page holds what it was given, escapes it, and refers to nothing outside its folder."""

import json
import re
from datetime import datetime
from html.parser import HTMLParser

import pytest

from scenefw.core.errors import StorageError
from scenefw.core.final_split import Ledger, look, opened
from scenefw.report.blocks import Drawing, Picture, Section, Text
from scenefw.report.page import Page
from scenefw.report.tables import Column, Table

TABLE = Table("Figures", (Column("a"),), (("ours <1>", (1.0,)),))
SECTIONS = [
    Section(
        "Results & more",
        (
            Text("3 < 4"),
            TABLE,
            Drawing("<svg xmlns='http://www.w3.org/2000/svg'></svg>", "curves"),
            Picture("pictures/a.png", "one", (("GLB", "meshes/a.glb"),)),
            Picture("pictures/b.png"),
        ),
    )
]


VOID = {"meta", "img", "br", "link"}


class _Checker(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.text, self.targets = [], "", []

    def handle_starttag(self, tag, attrs):
        self.targets += [value for name, value in attrs if name in {"src", "href"}]
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


def _folder(tmp_path):
    (tmp_path / "config.yaml").write_text("seed: 7\nname: <x>\n")
    record = {
        "seed": 7,
        "versions": {"torch": "2.6", "commit": "abcdef0123456"},
        "command": ["a=1"],
    }
    (tmp_path / "run.json").write_text(json.dumps(record))
    return tmp_path


def test_page_shows_everything(tmp_path):
    target = Page("A run").write(_folder(tmp_path), SECTIONS, {"instance_iou": 0.123456789})
    assert target == tmp_path / "report.html"
    checker = _Checker()
    checker.feed(target.read_text())
    assert checker.open == []
    for text in ("A run", "seed 7", "commit abcdef0123", "python -m scenefw a=1", "3 < 4", "2.6"):
        assert text in checker.text
    assert "ours <1>" in checker.text
    assert "name: <x>" in checker.text
    assert "instance_iou" in checker.text
    assert "0.123457" in checker.text


def test_page_refers_to_its_own_folder_only(tmp_path):
    target = Page().write(_folder(tmp_path), SECTIONS, {})
    checker = _Checker()
    checker.feed(target.read_text())
    assert set(checker.targets) == {"pictures/a.png", "meshes/a.glb", "pictures/b.png"}
    assert not re.search(r"url\(|@import|<script", target.read_text())


def test_page_without_a_record(tmp_path):
    text = Page("bare").write(tmp_path, [], {}).read_text()
    assert "bare" in text
    assert "Settings" not in text


def test_publishing_writes_the_document_too(tmp_path):
    target = tmp_path / "docs" / "results.md"
    Page("A run", publish=target).write(_folder(tmp_path), [Section("R", (TABLE,))], {})
    assert target.read_text().startswith("# A run")
    assert "| ours <1> | 1.000 |" in target.read_text()


def published(tmp_path, **settings):
    target, ledger = tmp_path / "docs" / "a" / "r.md", tmp_path / "docs" / "final.jsonl"
    folder = tmp_path / "run"
    folder.mkdir(exist_ok=True)
    page = Page("A run", **{"publish": target, "ledger": ledger, **settings})
    page.write(_folder(folder), [Section("R", (TABLE,))], {})
    return (target.read_text() if target.exists() else ""), Ledger(ledger).entries()


def test_a_published_page_says_how_often_the_final_split_was_evaluated(tmp_path):
    text, entries = published(tmp_path)
    assert "had not been evaluated by then" in text
    assert entries == []
    with opened():
        look("stacks", "abc")
        text, entries = published(tmp_path)
    assert "evaluated once by then ([all](../final.jsonl))" in text
    (entry,) = entries
    assert entry["data"] == {"stacks": "abc"}
    assert entry["commit"] == "abcdef0123456"
    assert entry["command"] == "python -m scenefw a=1"
    assert datetime.fromisoformat(entry["date"]).tzinfo is not None
    with opened():
        look("stacks", "abc")
        published(tmp_path)
    text, entries = published(tmp_path)
    assert "evaluated 2 times" in text
    assert len(entries) == 2


def test_pages_that_are_not_published_count_nothing(tmp_path):
    with opened():
        look("stacks", "abc")
        assert published(tmp_path, publish=None) == ("", [])


def test_nothing_is_published_that_could_not_be_counted(tmp_path):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "final.jsonl").write_text("cut off")
    with opened():
        look("stacks", "abc")
        with pytest.raises(StorageError, match="restore it"):
            published(tmp_path)
    assert not (tmp_path / "docs" / "a").exists()
