"""Pictures of examples: what was seen, what was predicted and what is true, side by side."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from scenefw.core.files import replacing
from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera, Float32
from scenefw.evaluation.examples import Example
from scenefw.report.palette import instance_colours
from scenefw.report.shading import Solid, draw, turned

Picture = NDArray[np.float32]

_TILE = (320, 240)  # width, height
_TITLE = 22  # pixels above a tile
_GAP = 6


def draw_example(example: Example) -> Picture:
    """RGB (H, W, 3) in [0, 1]: depth, partial TSDF, prediction and truth, each from two sides.

    Further samples are shown from behind, where they may differ.
    """
    seen_from = example.camera.resized(*_TILE)
    points = example.grid.centres()[(example.true_instances > 0) | (example.instances > 0)]
    front, aside, back = (turned(seen_from, points, turn) for turn in (0.0, 70.0, 180.0))
    bare = np.zeros_like(example.true_instances)
    predicted = _solid(example, example.tsdf, example.instances)
    true = _solid(example, example.true_tsdf, example.true_instances)
    tiles = {
        "depth": _window(depth_picture(example.depth), example.camera, points),
        "predicted": draw(predicted, front),
        "truth": draw(true, front),
        "partial TSDF, from aside": draw(_solid(example, _above_floor(example), bare), aside),
        "predicted, from behind": draw(predicted, back),
        "truth, from behind": draw(true, back),
    }
    for number, (tsdf, instances) in enumerate(example.others, start=2):
        tiles[f"sample {number}, from behind"] = draw(_solid(example, tsdf, instances), back)
    return beside(list(tiles.values()), list(tiles))


def depth_picture(depth: Float32) -> Picture:
    """RGB (H, W, 3) of a depth image (m): near is light, no measurement is white."""
    seen = depth > 0
    if not seen.any():
        return np.ones((*depth.shape, 3), np.float32)
    low, high = np.percentile(depth[seen], [1, 90])  # the far floor would take most colours
    near = 1 - np.clip((depth - low) / max(float(high - low), 1e-6), 0, 1)
    colours = colormaps["viridis"](near)[..., :3]
    return np.where(seen[..., None], colours, 1.0).astype(np.float32)


def beside(tiles: Sequence[Picture], titles: Sequence[str], columns: int = 3) -> Picture:
    """Tiles of one size in rows, each with its title above."""
    height, width = tiles[0].shape[:2]
    rows = -(-len(tiles) // columns)
    step_x, step_y = width + _GAP, height + _TITLE + _GAP
    sheet = Image.new("RGB", (columns * step_x - _GAP, rows * step_y - _GAP), "white")
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(14)
    for i, (tile, title) in enumerate(zip(tiles, titles, strict=True)):
        x, y = (i % columns) * step_x, (i // columns) * step_y
        pen.text((x + 2, y + 2), title, fill="#444444", font=font)
        pixels = np.rint(np.clip(tile, 0, 1) * 255).astype(np.uint8)
        sheet.paste(Image.fromarray(pixels), (x, y + _TITLE))
    return np.asarray(sheet, dtype=np.float32) / np.float32(255)


def save_picture(picture: Picture, path: Path) -> None:
    """Writes RGB (H, W, 3) in [0, 1]; the suffix chooses the format (.jpg, .png)."""
    image = Image.fromarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))
    with replacing(path) as temporary:
        image.save(temporary, quality=88, optimize=True)


def _solid(example: Example, tsdf: Float32, instances: NDArray[np.int32]) -> Solid:
    colours = instance_colours(int(max(instances.max(), 1)))
    return Solid(tsdf, instances, example.grid, colours)


def _above_floor(example: Example) -> Float32:
    """The partial TSDF without the seen floor, which would hide the shape of what it cuts."""
    heights = example.grid.centres()[..., 2]
    floor = heights < example.grid.voxel_size
    return np.where(floor, example.grid.truncation, example.partial).astype(np.float32)


def _window(picture: Picture, camera: Camera, points: NDArray[np.float64]) -> Picture:
    """The part of an image where points are, with some room about it, at the size of a tile."""
    local = transform_points(inverse(camera.T_world_camera), points)
    u = local[:, 0] / local[:, 2] * camera.fx + camera.cx
    v = local[:, 1] / local[:, 2] * camera.fy + camera.cy
    middle = (u.min() + u.max()) / 2, (v.min() + v.max()) / 2
    width = min(1.4 * max(np.ptp(u), np.ptp(v) * _TILE[0] / _TILE[1]), picture.shape[1])
    height = width * _TILE[1] / _TILE[0]
    left = float(np.clip(middle[0] - width / 2, 0, max(0, picture.shape[1] - width)))
    top = float(np.clip(middle[1] - height / 2, 0, max(0, picture.shape[0] - height)))
    image = Image.fromarray(np.rint(picture * 255).astype(np.uint8))
    box = (left, top, left + width, min(top + height, picture.shape[0]))
    shown = image.resize(_TILE, Image.Resampling.BICUBIC, box)
    return np.asarray(shown, dtype=np.float32) / np.float32(255)
