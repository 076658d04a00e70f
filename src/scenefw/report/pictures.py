"""Pictures as arrays: depth in colour, tiles side by side, files."""

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib import colormaps, get_data_path
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from scenefw.core.files import replacing
from scenefw.core.types import Float32

Picture = NDArray[np.float32]

_TITLE = 22  # pixels above a tile
_GAP = 6
_WIDEST = 1000  # pixels of a picture in a document
_LINE, _MARGIN, _CHIP, _APART = 22, 4, 17, 18  # pixels of a legend


@cache
def font_of(size: int) -> ImageFont.FreeTypeFont:
    """DejaVu Sans, which has the letters of most alphabets, at a height in pixels."""
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/DejaVuSans.ttf", size)


def depth_picture(depth: Float32) -> Picture:
    """RGB (H, W, 3) of a depth image (m): near is light, no measurement is white."""
    valid = depth > 0
    if not valid.any():
        return np.ones((*depth.shape, 3), np.float32)
    low, high = np.percentile(depth[valid], [1, 90])  # the far floor would use up most colours
    return coloured(depth, float(low), float(high))


def coloured(depth: Float32, low: float, high: float) -> Picture:
    """RGB (H, W, 3) of depths between two limits (m), light at the lower one, white where 0."""
    brightness = 1 - np.clip((depth - low) / max(high - low, 1e-6), 0, 1)
    colours = colormaps["viridis"](brightness)[..., :3]
    return np.where(depth[..., None] > 0, colours, 1.0).astype(np.float32)


def as_image(picture: Picture) -> Image.Image:
    """RGB (H, W, 3) in [0, 1] as an image of bytes."""
    return Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))


def smaller(picture: Picture, size: tuple[int, int]) -> Picture:
    """RGB (H, W, 3) in [0, 1] resampled to a width and a height (pixels)."""
    resized = as_image(picture).resize(size, Image.Resampling.LANCZOS)
    return np.asarray(resized, dtype=np.float32) / np.float32(255)


def beside(tiles: Sequence[Picture], titles: Sequence[str], columns: int = 3) -> Picture:
    """Tiles of one size in rows, each with its title above."""
    height, width = tiles[0].shape[:2]
    rows = -(-len(tiles) // columns)
    step_x, step_y = width + _GAP, height + _TITLE + _GAP
    sheet = Image.new("RGB", (columns * step_x - _GAP, rows * step_y - _GAP), "white")
    pen, font = ImageDraw.Draw(sheet), font_of(14)
    for i, (tile, title) in enumerate(zip(tiles, titles, strict=True)):
        x, y = (i % columns) * step_x, (i // columns) * step_y
        pen.text((x + 2, y + 2), title, fill="#444444", font=font)
        sheet.paste(as_image(tile), (x, y + _TITLE))
    return np.asarray(sheet, dtype=np.float32) / np.float32(255)


def stacked(top: Picture, bottom: Picture) -> Picture:
    """One picture above another of the same width."""
    return np.concatenate([top, bottom])


def legend(colours: Mapping[str, Sequence[float]], width: int) -> Picture:
    """RGB (22 per line, width, 3): a square of each colour with its name; wrapped, not cut off.

    Args:
        colours: red, green, blue in [0, 1] by name.
        width: pixels.
    """
    font = font_of(13)
    places: list[tuple[int, int]] = []
    x, line = _MARGIN, 0
    for name in colours:
        entry_width = _CHIP + int(font.getlength(name))
        if x > _MARGIN and x + entry_width + _MARGIN > width:
            x, line = _MARGIN, line + 1
        places.append((x, line * _LINE))
        x += entry_width + _APART
    strip = Image.new("RGB", (width, (line + 1) * _LINE), "white")
    pen = ImageDraw.Draw(strip)
    for (x, y), (name, colour) in zip(places, colours.items(), strict=True):
        red, green, blue = (round(255 * part) for part in colour)
        pen.rectangle((x, y + 5, x + 12, y + 17), fill=(red, green, blue))
        pen.text((x + _CHIP, y + 3), name, fill="#444444", font=font)
    return np.asarray(strip, dtype=np.float32) / np.float32(255)


def save_picture(picture: Picture, path: Path, *, fast: bool = False) -> None:
    """Writes RGB (H, W, 3) in [0, 1]; the suffix chooses the format (.jpg, .png).

    Args:
        picture: to write.
        path: the file, replaced as a whole.
        fast: PNG files in a third of the time, a quarter larger.
    """
    image = as_image(picture)
    options: dict[str, int] = {"quality": 88, "optimize": True}
    if path.suffix == ".png":
        options = {"compress_level": 1 if fast else 6}
    with replacing(path) as temporary:
        image.save(temporary, **options)


def save_for_document(image: Image.Image, path: Path) -> None:
    """Writes an image in as few bytes as documents need: WebP, at most 1000 pixels wide."""
    image = image.convert("RGB")
    if image.width > _WIDEST:
        size = (_WIDEST, round(image.height * _WIDEST / image.width))
        image = image.resize(size, Image.Resampling.LANCZOS)
    with replacing(path) as temporary:
        image.save(temporary, "webp", quality=70, method=6)
