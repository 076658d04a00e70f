"""A small table of known labels, and recordings of it."""

import numpy as np

from scenefw.core.geometry import rigid
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.types import Camera
from scenefw_painting.height_map import view

GRID = HeightGrid(129)
CLASSES = ("surface", "remote_control", "keyboard", "model_plane")
LENS = Camera().resized(80, 60)


def table():
    """A keyboard and a remote control as boxes on a table."""
    x, y = np.moveaxis(GRID.positions(), -1, 0)
    labels = np.zeros(GRID.shape, np.int32)
    labels[(np.abs(x - 0.05) < 0.12) & (np.abs(y) < 0.06)] = 2
    labels[(np.abs(x + 0.2) < 0.06) & (np.abs(y - 0.1) < 0.03)] = 1
    heights = np.where(labels > 0, 0.03, 0).astype(np.float32)
    colour = np.array([[150, 120, 90], [40, 40, 40], [220, 220, 215], [0, 0, 0]], np.uint8)[labels]
    one = np.ones(GRID.shape, np.float32)
    return HeightMap(GRID, heights, colour, one, 0 * one, labels=labels, classes=CLASSES)


def frames(count=6, step=0.04, height=0.6):
    """Frames of a camera that looks down and moves to the right."""
    down = np.diag([1.0, -1.0, -1.0])
    start = -step * (count - 1) / 2
    for i in range(count):
        pose = rigid(down, (start + step * i, 0.02, height))
        yield view(table(), LENS.moved(pose))
