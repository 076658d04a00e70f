"""Markdown for the documents: tables and origin in, pictures that must stay here out."""

import re

from PIL import Image

from scenefw.report.blocks import Code, Drawing, Picture, Points, Section, Text
from scenefw.report.publication import publish
from scenefw.report.tables import Column, Table

RECORD = {
    "seed": 3,
    "versions": {"torch": "2.6", "commit": "0123456789abc"},
    "command": [
        "run=evaluate",
        "report.title=Two words",
        "paths.output=/tmp/x",
        "report.publish=y.md",
    ],
}


def test_published_file_and_its_pictures(tmp_path):
    folder = tmp_path / "run"
    (folder / "pictures").mkdir(parents=True)
    for name in ("open", "secret"):
        Image.new("RGB", (1600, 300)).save(folder / "pictures" / f"{name}.png")
    section = Section(
        "Results",
        (
            Text("Words."),
            Points(("one", "two")),
            Code(("first --line", "second")),
            Table("T", (Column("a"),), (("ours", (1.0,)),), note="10 scenes"),
            Drawing("<svg>currentColor</svg>", "curve"),
            Picture("pictures/open.png", "simulated"),
            Picture("pictures/secret.png", "real", shareable=False),
        ),
    )
    hidden = Section("Unseen", (Picture("pictures/secret.png", "real", shareable=False),))
    target = tmp_path / "docs" / "r.md"
    publish(target, "Reconstruction", [section, hidden], folder, RECORD)
    text = target.read_text()
    for words in (
        "# Reconstruction",
        "python -m scenefw run=evaluate 'report.title=Two words'",
        "seed 3, commit 0123456789, torch 2.6.",
        "| ours | 1.000 |",
        "10 scenes",
        "- one\n- two\n",
        "```\nfirst --line\nsecond\n```",
    ):
        assert words in text
    assert "secret" not in text
    assert "Unseen" not in text
    assert "/tmp/x" not in text
    pictures = re.findall(r"\]\((.*?)\)", text)
    assert [picture.rpartition(".")[2] for picture in pictures] == ["svg", "webp"]
    assert all((target.parent / picture).is_file() for picture in pictures)
    assert not list(target.parent.rglob("*secret*"))
    assert "currentColor" not in next(target.parent.rglob("*.svg")).read_text()
