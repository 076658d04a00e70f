"""Pictures of examples: what was seen, what was predicted and what is true, side by side."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera, Float32
from scenefw.evaluation.stacks.examples import Example
from scenefw.report.palette import instance_colours
from scenefw.report.pictures import Picture, beside, depth_picture
from scenefw.report.shading import Solid, draw, turned

_TILE = (320, 240)  # width, height


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
    for number, (tsdf, instances) in enumerate(example.further_samples, start=2):
        tiles[f"sample {number}, from behind"] = draw(_solid(example, tsdf, instances), back)
    return beside(list(tiles.values()), list(tiles))


def _solid(example: Example, tsdf: Float32, instances: NDArray[np.int32]) -> Solid:
    colours = instance_colours(int(max(instances.max(), 1)))
    return Solid(tsdf, instances, example.grid, colours)


def _above_floor(example: Example) -> Float32:
    """The partial TSDF without the seen floor, which would hide the shape of what it cuts."""
    heights = example.grid.centres()[..., 2]
    floor = heights < example.grid.voxel_size
    return np.where(floor, example.grid.truncation, example.partial).astype(np.float32)


def _window(picture: Picture, camera: Camera, points: NDArray[np.float64]) -> Picture:
    """The part of an image around the points, with a margin, at the size of a tile."""
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
    tile = image.resize(_TILE, Image.Resampling.BICUBIC, box)
    return np.asarray(tile, dtype=np.float32) / np.float32(255)
