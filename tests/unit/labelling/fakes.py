"""A table of 33 x 33 vertices whose frames each reveal some columns, and label sources for it."""

from dataclasses import replace

import numpy as np

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.types import Camera, Frame

GRID = HeightGrid(vertices=33, extent=0.32, lower=(-0.16, -0.16), levels=6)
CLASSES = ("surface", "book", "pen")
SIDE = GRID.vertices


def truth():
    """Surface with a book in the middle rows and a pen along one row."""
    labels = np.zeros(GRID.shape, np.int32)
    labels[10:20, :] = 1
    labels[25] = 2
    heights = np.where(labels > 0, 0.02, 0).astype(np.float32)
    colour = np.repeat(labels[..., None] * 80, 3, axis=-1).astype(np.uint8)
    one = np.ones(GRID.shape, np.float32)
    return HeightMap(GRID, heights, colour, one, 0 * one, labels=labels, classes=CLASSES)


def frames(count, width=8):
    """Frames as tall as the map; frame i shows `width` columns from column i * width on."""
    world, lens = truth(), Camera(width=width, height=SIDE, fx=10, fy=10, cx=0, cy=0)
    for i in range(count):
        first = i * width % SIDE
        columns = [min(first + c, SIDE - 1) for c in range(width)]
        pose = np.eye(4)
        pose[0, 3] = first  # the fakes read from it where they are
        yield Frame(
            world.heights[:, columns] + 0.3,
            replace(lens, T_world_camera=pose),
            world.colour[:, columns],
            world.labels[:, columns],
            f"frame {i}",
        )


def columns_of(frame):
    first = round(float(frame.camera.T_world_camera[0, 3]))
    return [min(first + c, SIDE - 1) for c in range(frame.camera.width)]


class Heights:
    grid = GRID

    def begin(self, previous=None, state=None):
        running = RunningHeights()
        if previous is not None:
            running.heights, running.confidence = previous.heights, previous.confidence
        if state is not None:
            running.heights, running.confidence = state["heights"], state["confidence"]
        return running


class RunningHeights:
    def __init__(self):
        self.heights = np.full(GRID.shape, np.nan, np.float32)
        self.confidence = np.zeros(GRID.shape, np.float32)
        self.asked = 0

    def add(self, frame):
        columns = columns_of(frame)
        self.heights, self.confidence = self.heights.copy(), self.confidence.copy()
        self.heights[:, columns] = frame.depth - np.float32(0.3)
        self.confidence[:, columns] += 1

    def height_map(self):
        self.asked += 1
        colour = np.where(np.isfinite(self.heights)[..., None], truth().colour, 0)
        variance = np.where(np.isfinite(self.heights), 1e-6, np.nan).astype(np.float32)
        return HeightMap(GRID, self.heights, colour.astype(np.uint8), self.confidence, variance)

    def state(self):
        return {"heights": self.heights, "confidence": self.confidence}


class Labels:
    """Multiplies probabilities column by column."""

    reads_map = False

    def begin(self, grid, classes, previous=None, state=None):
        running = RunningLabels(classes)
        if state is not None:
            running.logs = state["logs"].copy()
        elif previous is not None:
            running.logs = np.log(previous)
        return running


class RunningLabels:
    def __init__(self, classes):
        self.logs = np.zeros((classes, *GRID.shape), np.float32)

    def add(self, probabilities, frame, heights):
        for i, column in enumerate(columns_of(frame)):
            self.logs[:, :, column] += np.log(np.maximum(probabilities[:, :, i], 1e-3))

    def probabilities(self):
        shifted = np.exp(self.logs - self.logs.max(axis=0))
        return shifted / shifted.sum(axis=0)

    def state(self):
        return {"logs": self.logs}


def confident(labels, sure=0.9):
    """Probabilities (C, ...) of labels, the rest shared by the other classes."""
    rest = (1 - sure) / (len(CLASSES) - 1)
    return np.stack([np.where(labels == c, sure, rest) for c in range(len(CLASSES))]).astype(
        np.float32
    )


class Views:
    """Says what is true, but calls every pen a book."""

    classes = CLASSES

    def __init__(self):
        self.calls = 0

    def label(self, frame):
        self.calls += 1
        return confident(np.where(frame.labels == 2, 1, frame.labels))


class Maps:
    """Says what is true of seen vertices, but takes the upper half of a book for a pen."""

    classes = CLASSES

    def __init__(self):
        self.calls = 0

    def label_map(self, height_map):
        self.calls += 1
        labels = truth().labels.copy()
        labels[10:15] = 2
        uniform = np.full((3, *GRID.shape), 1 / 3, np.float32)
        return np.where(height_map.seen, confident(labels), uniform)


class Scenes:
    """Two scenes that are the same."""

    classes = CLASSES

    def __len__(self):
        return 2

    def frames(self, scene, count, start=0):
        return iter(list(frames(start + count))[start:])

    def truth(self, scene):
        return truth()
