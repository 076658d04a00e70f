"""Pictures of labelled maps: colour, labels, errors and where labels come from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.height_maps import HeightMap
from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS
from scenefw.report.palette import class_colours
from scenefw.report.pictures import beside, legend, stacked

Picture = NDArray[np.float32]

UNSEEN = (0.15, 0.15, 0.17)
SOURCES = {
    "views": (FROM_VIEWS, (0.34, 0.55, 0.85)),
    "map": (FROM_MAP, (0.90, 0.56, 0.25)),
    "both": (FROM_BOTH, (0.62, 0.75, 0.58)),
}
"""Value and colour of each origin of a label."""
TILE = 256  # pixels of a tile
_TOP = 0.06  # m: heights from here on have one colour


def label_picture(labels: NDArray[Any], classes: int) -> Picture:
    """RGB (H, W, 3) of class ids, dark where unknown."""
    palette = np.array([*class_colours(classes), UNSEEN], np.float32)
    return palette[np.where((labels >= 0) & (labels < classes), labels, classes)]


def source_picture(sources: NDArray[np.uint8]) -> Picture:
    """RGB (H, W, 3) of where labels come from, dark where there is none."""
    picture = np.full((*sources.shape, 3), UNSEEN, np.float32)
    for value, colour in SOURCES.values():
        picture[sources == value] = colour
    return picture


def height_picture(height_map: HeightMap, top: float = _TOP) -> Picture:
    """RGB (V, V, 3) of heights: the table dark, `top` (m) and higher light, unseen grey."""
    from matplotlib import colormaps

    heights = np.nan_to_num(height_map.heights, nan=0.0)
    colours = colormaps["cividis"](np.clip(heights / top, 0, 1))[..., :3].astype(np.float32)
    return np.where(height_map.seen[..., None], colours, np.float32(0.5))


def map_picture(height_map: HeightMap) -> Picture:
    """RGB: colour, heights, labels and sources of a map side by side, with a legend below."""
    labels, sources = height_map.labels, height_map.sources
    tiles = {
        "colour": colour_picture(height_map),
        f"height: dark 0, light {100 * _TOP:.0f} cm or more, grey not seen": height_picture(
            height_map
        ),
    }
    if labels is not None:
        tiles["labels"] = label_picture(labels, len(height_map.classes))
    if sources is not None:
        tiles["labels come from"] = source_picture(sources)
    side = 2 * TILE
    sheet = beside([resized(tile, side) for tile in tiles.values()], list(tiles), columns=2)
    return stacked(sheet, class_legend(height_map.classes, sheet.shape[1]))


def colour_picture(height_map: HeightMap) -> Picture:
    """RGB (V, V, 3) of the fused colour, dark where unseen."""
    return shaded(height_map.colour, height_map.seen)


def class_legend(classes: Sequence[str], width: int) -> Picture:
    """RGB (H, width, 3): the colours of classes and of where labels come from."""
    names = dict(zip(classes, class_colours(len(classes)), strict=True))
    return legend(names | source_names() | {"not seen": UNSEEN}, width)


def resized(picture: Picture, side: int) -> Picture:
    """The picture at `side` x `side` pixels, nearest pixel."""
    image = Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    scaled = image.resize((side, side), Image.Resampling.NEAREST)
    return np.asarray(scaled, dtype=np.float32) / np.float32(255)


def shaded(colour: NDArray[np.uint8], observed: NDArray[np.bool_]) -> Picture:
    """RGB (H, W, 3) of colours, dark where unseen."""
    picture: Picture = (colour / 255).astype(np.float32)
    picture[~observed] = UNSEEN
    return picture


def source_names() -> dict[str, Sequence[float]]:
    """Colours of a legend of where labels come from."""
    return {f"from {name}": colour for name, (_, colour) in SOURCES.items()}
