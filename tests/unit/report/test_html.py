"""Every kind of block has a template, and pictures that follow each other stand together."""

from typing import get_args

import pytest

from scenefw.report.blocks import Block, Code, Drawing, Picture, Points, Scenes, Section, Text
from scenefw.report.html import render
from scenefw.report.tables import Column, Table

BLOCKS = {
    Text: (Text("a < b"), "<p>a &lt; b</p>"),
    Points: (Points(("one", "<two>")), "<ul><li>one</li><li>&lt;two&gt;</li></ul>"),
    Code: (Code(("x < 1", "y")), "<pre class=command>x &lt; 1\ny</pre>"),
    Drawing: (Drawing("<svg></svg>", "a & b"), "<svg></svg><p class=note>a &amp; b</p>"),
    Picture: (Picture("a.png", links=(("GLB", "a.glb"),)), '<a href="a.glb">GLB</a>'),
    Scenes: (Scenes({"a": "</script>"}, "eA=="), '{"a": "\\u003c/script\\u003e"}</script>'),
    Table: (Table("T", (Column("c"),), (("<r>", (1.0,)),)), "<th scope=row>&lt;r&gt;</th>"),
}


def page_of(*blocks):
    return render(
        "page.html.j2",
        title="T",
        style="",
        facts=[],
        command="",
        sections=[Section("S", blocks)],
        libraries=(),
        figures={},
        settings=None,
        versions=None,
    )


@pytest.mark.parametrize("kind", get_args(Block))
def test_a_block_is_drawn_and_escaped(kind):
    block, expected = BLOCKS[kind]
    assert expected in page_of(block)


def test_pictures_that_follow_each_other_share_a_gallery():
    one = Picture("a.png")
    page = page_of(one, one, Text("between"), one)
    galleries = [part.split("</div>")[0] for part in page.split("<div class=gallery>")[1:]]
    assert [gallery.count("<img") for gallery in galleries] == [2, 1]
