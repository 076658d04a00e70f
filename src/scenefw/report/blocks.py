"""Building blocks of pages and documents: text, drawings, pictures and tables, in sections."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scenefw.report.tables import Table


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str


@dataclass(frozen=True)
class Points:
    """A list of points."""

    points: tuple[str, ...]


@dataclass(frozen=True)
class Code:
    """Commands, line by line."""

    lines: tuple[str, ...]


@dataclass(frozen=True)
class Drawing:
    """A figure as SVG, with a caption."""

    svg: str
    caption: str = ""


@dataclass(frozen=True)
class Picture:
    """An image file in the folder of the page, with a caption and the files that belong to it.

    Args:
        path: relative to the page.
        caption: one line.
        links: (text, path relative to the page), e.g. of meshes.
        shareable: False for pictures of data that must not be published.
    """

    path: str
    caption: str = ""
    links: tuple[tuple[str, str], ...] = ()
    shareable: bool = True


@dataclass(frozen=True)
class Scenes:
    """Scenes to turn, one at a time; `report.scenes3d.packed` makes it.

    Args:
        header: what is where in the data, as JSON types.
        data: base64 of gzipped arrays.
        caption: one line.
    """

    header: Mapping[str, Any]
    data: str
    caption: str = ""


Block = Text | Points | Code | Drawing | Picture | Scenes | Table


@dataclass(frozen=True)
class Section:
    """A heading and the blocks below it."""

    title: str
    blocks: tuple[Block, ...]
