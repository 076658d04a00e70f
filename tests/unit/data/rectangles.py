"""A source of scenes of coloured rectangles on a grey table, each class of a colour and height."""

import numpy as np

from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.rng import generator
from scenefw.core.types import Camera, Frame

COLOURS = np.array([[120, 120, 120], [200, 40, 40], [40, 60, 200]], np.uint8)
HEIGHTS = np.array([0.0, 0.02, 0.03], np.float32)


class Rectangles:
    """As the table-top sources: FrameSource."""

    classes = ("surface", "red", "blue")

    def __init__(self, scenes=2, size=(48, 40), vertices=65, seed=0):
        self.scenes, self.size, self.seed = scenes, size, seed
        self.grid = HeightGrid(vertices, extent=0.064)
        self.fetched = 0

    def __len__(self):
        return self.scenes

    def frames(self, scene, count, start=0):
        width, height = self.size
        camera = Camera(
            width, height, 60.0, 60.0, width / 2, height / 2, look_at((0, -0.1, 0.3), (0, 0, 0))
        )
        for view in range(start, start + count):
            self.fetched += 1
            labels, colour = self._draw((height, width), scene, view)
            depth = (0.3 - HEIGHTS[labels]).astype(np.float32)
            depth[0, 0] = 0
            yield Frame(depth, camera, colour, labels, f"rectangles/{scene}/{view}")

    def truth(self, scene):
        self.fetched += 1
        labels, colour = self._draw(self.grid.shape, scene, 10_000)
        ones, zeros = np.ones(self.grid.shape, np.float32), np.zeros(self.grid.shape, np.float32)
        return HeightMap(
            self.grid, HEIGHTS[labels], colour, ones, zeros, labels=labels, classes=self.classes
        )

    def _draw(self, shape, scene, view):
        rng = generator(self.seed, scene, view)
        labels = np.zeros(shape, np.int32)
        for label in (1, 2, 1, 2):
            top, left = (int(rng.integers(n - 14)) for n in shape)
            labels[top : top + 14, left : left + 14] = label
        noise = rng.integers(-15, 16, (*shape, 3))
        return labels, (COLOURS[labels] + noise).clip(0, 255).astype(np.uint8)
