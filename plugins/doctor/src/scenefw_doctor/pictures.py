"""A picture of what is seen of a scene before a prediction: depth, floor, objects, cube."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.observation.points import world_points
from scenefw.report.palette import Colour
from scenefw.report.pictures import Picture, beside, depth_picture

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Frame, GridSpec
    from scenefw_doctor.examination import Examination

_FLOOR, _OBJECTS, _OTHER = (0.0, 0.62, 0.45), (0.90, 0.60, 0.0), (0.8, 0.47, 0.65)
_TINT = 0.55  # share of the colour
_ON_FLOOR = 0.015  # m
_HALF = 0.8  # m from the middle to the picture's upper edge, from above
_INK = (0.3, 0.3, 0.3)


def draw_examination(examination: Examination, grid: GridSpec) -> Picture:
    """RGB (H, W, 3) in [0, 1]: the image, its depth, what counts as what, and the cube from above.

    Args:
        examination: its frame must have been read.
        grid: of the cube.
    """
    frame = examination.frame
    assert frame is not None
    image = _image(frame)
    tiles, titles = [image, depth_picture(frame.depth)], ["image", "depth: white is missing"]
    if examination.floor is not None:
        pose = examination.floor.T_world_camera
        if examination.workspace is not None:
            pose = examination.workspace.frame.camera.T_world_camera
        points = world_points(replace(frame, camera=frame.camera.moved(pose)))
        kinds = _kinds(examination, points)
        tiles += [_tinted(image, kinds), _from_above(points, kinds, grid, frame.depth.shape)]
        titles += ["green: floor, orange: objects, pink: left out", "from above, with the cube"]
    return beside(tiles, titles, columns=2)


def _image(frame: Frame) -> Picture:
    if frame.colour is not None:
        return (frame.colour / 255).astype(np.float32)
    grey = depth_picture(frame.depth).mean(axis=-1, keepdims=True)
    return np.repeat(grey, 3, axis=-1)


def _kinds(examination: Examination, points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Of each pixel: 0 nothing, 1 floor, 2 objects, 3 what is left out."""
    height = np.nan_to_num(points[..., 2], nan=-np.inf)
    kinds = np.where(height > _ON_FLOOR, 3, 0)
    kinds[np.abs(height) <= _ON_FLOOR] = 1
    if examination.workspace is not None:
        kinds[examination.workspace.objects] = 2
    return kinds


def _tinted(image: Picture, kinds: NDArray[np.int64]) -> Picture:
    table = np.array([(0, 0, 0), _FLOOR, _OBJECTS, _OTHER], dtype=np.float32)
    tinted = image * (1 - _TINT) + table[kinds] * _TINT
    return np.where(kinds[..., None] > 0, tinted, image).astype(np.float32)


def _from_above(
    points: NDArray[np.float64],
    kinds: NDArray[np.int64],
    grid: GridSpec,
    shape: tuple[int, ...],
) -> Picture:
    """Points on a white sheet, x to the right and y up, and the sides of the cube."""
    height, width = shape
    sheet = np.ones((height, width, 3), dtype=np.float32)
    scale = height / (2 * _HALF)
    for kind, colour in ((3, _OTHER), (1, _FLOOR), (2, _OBJECTS)):
        x, y = points[kinds == kind][:, :2].T
        _dot(sheet, x * scale + width / 2, height / 2 - y * scale, colour)
    low = np.array(grid.lower[:2])
    along = np.linspace(0, grid.extent, 4 * height)
    for side in (0.0, grid.extent):
        for x, y in ((low[0] + along, low[1] + side + 0 * along), (low[0] + side, low[1] + along)):
            _dot(sheet, x * scale + width / 2, height / 2 - y * scale, _INK)
    return sheet


def _dot(sheet: Picture, x: NDArray[np.float64], y: NDArray[np.float64], colour: Colour) -> None:
    column, row = (np.floor(np.broadcast_to(v, np.shape(y))).astype(int) for v in (x, y))
    inside = (row >= 0) & (row < sheet.shape[0]) & (column >= 0) & (column < sheet.shape[1])
    sheet[row[inside], column[inside]] = colour
