"""One picture of a prediction: what the camera saw, and the complete objects from two sides."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from scenefw.core.files import replacing
from scenefw.core.types import Float32, Frame, GridSpec, SceneEstimate
from scenefw.postprocessing.surfaces import surface
from scenefw.report.palette import Colour
from scenefw.report.pictures import as_image, coloured, font_of
from scenefw.report.shading import Picture, Solid, draw, turned
from scenefw.report.surfaces import Surfaces
from scenefw.report.window import SIZE, cropped, vertices, window

_MARGIN, _GAP, _HEAD, _TITLE, _ROW = 12, 8, 48, 24, 24  # pixels
_WIDTH = 2 * _MARGIN + 2 * SIZE[0] + _GAP
_SMALL = ((_WIDTH - 2 * _MARGIN - 2 * _GAP) // 3, 280)  # of the pictures above
_COLUMNS, _CHIP = 5, 14  # objects in a row of the legend, and the side of their squares
_BAR, _STEPS = (120, 8), 120  # width and height of the scale of depth, and its shades
_INK = "#333333"
_TURN_OF_PARTIAL = 70.0
_SEEN = (0.35, 0.47, 0.6)


def write_overview(
    path: Path,
    estimate: SceneEstimate,
    partial: Float32,
    colours: Sequence[Colour],
    views: tuple[Picture, Picture],
    frame: Frame | None = None,
) -> None:
    """Writes a PNG with colour, depth and partial TSDF above, the predicted objects below.

    Args:
        path: the file, replaced as a whole.
        estimate: the predicted scene.
        partial: partial TSDF (X, Y, Z) in metres.
        colours: red, green, blue in [0, 1] of each object, in their order.
        views: of the objects, see `window.two_views`.
        frame: the image as it was read; None takes the estimate's, without its background.
    """
    frame = frame or estimate.frame
    rows, columns = window(estimate)
    camera = cropped(estimate.frame.camera, rows, columns)
    points = vertices(estimate)
    solid = _partial(partial, estimate.grid)
    upper = _HEAD
    lower = upper + _TITLE + _SMALL[1] + _GAP
    legend = lower + _TITLE + SIZE[1] + _GAP
    count = len(estimate.objects)
    sheet = Image.new("RGB", (_WIDTH, legend + _ROW * (1 + -(-count // _COLUMNS)) + _GAP), "white")
    name = estimate.frame.name or "scene"
    _say(sheet, _MARGIN, _HEAD // 2, f"{name}: {count} object{'' if count == 1 else 's'}", 22)
    of_partial = draw(solid, turned(camera.resized(*_SMALL), points, _TURN_OF_PARTIAL))
    above = {
        "colour": _colour(frame, rows, columns),
        "depth": _depth(frame.depth[rows, columns], estimate.frame.depth[rows, columns]),
        "partial TSDF: what was seen, from the side": as_image(of_partial),
    }
    below = {
        "predicted objects, from the camera": as_image(views[0]),
        "from behind": as_image(views[1]),
    }
    for top, tiles in ((upper, above), (lower, below)):
        for i, (title, tile) in enumerate(tiles.items()):
            left = _MARGIN + i * (tile.width + _GAP)
            _say(sheet, left, top + _TITLE // 2, title)
            sheet.paste(tile, (left, top + _TITLE))
    _legend(sheet, legend, estimate, colours)
    with replacing(path) as temporary:
        sheet.save(temporary, compress_level=1)


def _partial(distance: Float32, grid: GridSpec) -> Solid:
    """The partial TSDF without the floor, which is drawn as a plane."""
    heights = grid.centres()[0, 0, :, 2]
    field = np.where(heights < grid.voxel_size / 2, np.float32(grid.truncation), distance)
    mesh = surface(field, grid)
    surfaces = Surfaces({} if mesh is None else {1: mesh})
    return Solid(field, (field < 0).astype(np.int32), grid, [_SEEN], surfaces=surfaces)


def _say(sheet: Image.Image, x: float, y: float, text: str, size: int = 14) -> None:
    """Text that begins at x, with y in its middle."""
    ImageDraw.Draw(sheet).text((x, y), text, fill=_INK, font=font_of(size), anchor="lm")


def _colour(frame: Frame, rows: slice, columns: slice) -> Image.Image:
    if frame.colour is not None:
        part = Image.fromarray(np.ascontiguousarray(frame.colour[rows, columns]))
        return part.resize(_SMALL, Image.Resampling.LANCZOS)
    tile = Image.new("RGB", _SMALL, "#f4f4f4")
    font, middle = font_of(14), (_SMALL[0] / 2, _SMALL[1] / 2)
    ImageDraw.Draw(tile).text(middle, "no colour image", fill="#888888", font=font, anchor="mm")
    return tile


def _depth(depth: Float32, foreground: Float32) -> Image.Image:
    """Measured depth, in the range of the part that was used."""
    measured = foreground[foreground > 0]
    low, high = np.percentile(measured, (1, 99)) if measured.size else (0.0, 1.0)
    picture = coloured(depth, float(low), float(high))
    tile = as_image(picture).resize(_SMALL, Image.Resampling.NEAREST)
    scale = np.tile(np.linspace(low, high, _STEPS, dtype=np.float32), (_BAR[1], 1))
    left, top = 12, _SMALL[1] - 12 - _BAR[1]
    if not low > 0:
        return tile
    tile.paste(as_image(coloured(scale, float(low), float(high))).resize(_BAR), (left, top))
    pen, font = ImageDraw.Draw(tile), font_of(12)
    for x, text, anchor in ((0, f"{low:.2f}", "ls"), (_BAR[0], f"{high:.2f} m", "rs")):
        pen.text(
            (left + x, top - 4), text, fill="white", font=font, anchor=anchor, stroke_width=2,
            stroke_fill=_INK,
        )  # fmt: skip
    return tile


def _legend(
    sheet: Image.Image, top: int, estimate: SceneEstimate, colours: Sequence[Colour]
) -> None:
    """A square per object with its number, size and confidence, in rows below a title."""
    if not estimate.objects:
        return
    _say(sheet, _MARGIN, top + _ROW / 2, "objects: number, size, confidence")
    pen = ImageDraw.Draw(sheet)
    for index, (item, colour) in enumerate(zip(estimate.objects, colours, strict=True)):
        x = _MARGIN + index % _COLUMNS * (_WIDTH - 2 * _MARGIN) // _COLUMNS
        y = top + _ROW * (1.5 + index // _COLUMNS)
        red, green, blue = (round(255 * part) for part in colour)
        corners = (x, y - _CHIP / 2, x + _CHIP, y + _CHIP / 2)
        pen.rectangle(corners, fill=(red, green, blue))
        size = " x ".join(f"{100 * side:.0f}" for side in item.extents)
        _say(sheet, x + _CHIP + 6, y, f"{item.id}   {size} cm   {item.confidence:.0%}", 12)
