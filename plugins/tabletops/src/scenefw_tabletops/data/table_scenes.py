"""Table-top scenes as sources of frames: views on demand, kept on disk.

    source = registry.build("dataset", "tabletop", split="test", limit=2)
    for frame in source.frames(scene=0, count=100):
        ...                                   # depth, colour, labels, camera with its pose
    truth = source.truth(0)                   # heights, colour, labels from above

Other options: `tabletop_small` (seven classes of small things), `tabletop_shapenet` (models from a
folder of ShapeNetCore). `cache=None` renders every time; what comes out is the same.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.final_split import FINAL, look
from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labelling_protocols import TabletopRenderer, TabletopSource
from scenefw.core.settings import COUNT
from scenefw.core.tabletop import TabletopGeometry, TabletopScene
from scenefw.core.types import Camera, Float64, Frame
from scenefw_tabletops.data.view_cache import ViewCache, exact, key_of

_VIEW_STREAM = 1  # apart from the stream that makes the scene
_FINAL_SEED = 20261  # so that no run before has seen scenes or views of the final split


class TabletopScenes:
    """Views and ground truth of procedural table-tops (thesis 4.6).

    Cameras look at points all over the table from random sides, turned at random about their
    axis. Scene i of the data set depends on (seed, i) alone, its view j on (seed, i, j); depth is
    a multiple of 0.05 mm, whether or not it was read from the cache.

    Args:
        scenes: makes the scenes.
        renderer: makes the images.
        split: train, validation (or val), test, or final, which only releases may read
            (`core.final_split`) and which has a seed of its own.
        limit: at most this many scenes; None = all.
        seed: of scenes and views.
        size: width and height of images (pixels) of a camera with 45 degrees of vertical view.
        heights: lowest and highest camera over the table (m).
        angles: least and greatest angle of the view from straight down (degrees).
        reach: points looked at lie in +-reach (m).
        vertices: of the ground truth's grid, per side.
        cache: folder for rendered views, None = render every time. Entries are named by all that
            decides what they show, so a folder may serve any number of settings.

    Attributes:
        lens: the camera at no particular pose.

    Raises:
        ConfigError: numbers that make no view, no such split, or a final one that is not open.
    """

    DRAWS = 6
    """Random numbers that make a camera's pose."""

    def __init__(
        self,
        scenes: TabletopSource,
        renderer: TabletopRenderer,
        split: str = "train",
        limit: int | None = None,
        seed: int = 0,
        size: Sequence[int] = (320, 240),
        heights: Sequence[float] = (0.18, 0.40),
        angles: Sequence[float] = (0.0, 40.0),
        reach: float = 0.5,
        vertices: int = 1025,
        cache: str | None = None,
    ) -> None:
        _require(size, heights, angles, limit)
        self.scenes, self.renderer = scenes, renderer
        self.classes = tuple(scenes.classes)
        self.numbers = scenes.numbers({"val": "validation"}.get(split, split))[:limit]
        self.seed, self.reach = _FINAL_SEED if split == FINAL else seed, reach
        self.heights = (float(heights[0]), float(heights[1]))
        self.angles = (float(angles[0]), float(angles[1]))
        self.grid = HeightGrid(vertices)
        self.cache = None if cache is None else Path(cache)
        self.lens = Camera().resized(int(size[0]), int(size[1]))
        self._last: tuple[int, TabletopGeometry] | None = None
        self._stores: dict[int, ViewCache] = {}
        if split == FINAL:
            look("tabletop_final", self._digest())

    def __len__(self) -> int:
        return len(self.numbers)

    def scene(self, scene: int) -> TabletopScene:
        """Parameters of scene number 0 .. len - 1 of this split.

        Raises:
            InputError: there is no such scene.
        """
        if not 0 <= scene < len(self):
            raise InputError(f"scene {scene} of {len(self)}; give 0 to {len(self) - 1}")
        return self.scenes.generate(self.numbers[scene], self.seed)

    def camera(self, scene: int, view: int) -> Camera:
        """The camera of a view."""
        rng = streams.generator(self.seed, self.numbers[scene], _VIEW_STREAM, view)
        return self.lens.moved(self.poses(rng.random((1, self.DRAWS)))[0])

    def poses(self, draws: Float64) -> Float64:
        """`T_world_camera` (B, 4, 4) of cameras by numbers (B, DRAWS) in [0, 1)."""
        low = [-self.reach, -self.reach, self.heights[0], np.deg2rad(self.angles[0]), 0, 0]
        high = [self.reach, self.reach, self.heights[1], np.deg2rad(self.angles[1]), 2 * np.pi]
        x, y, height, angle, side, roll = (low + np.subtract([*high, 2 * np.pi], low) * draws).T
        target = np.stack([x, y, np.zeros_like(x)], axis=-1)
        offset = height * np.tan(angle)
        eye = target + np.stack([offset * np.cos(side), offset * np.sin(side), height], axis=-1)
        poses = look_at(eye, target)
        c, s = np.cos(roll)[:, None], np.sin(roll)[:, None]
        right, down = poses[:, :3, 0].copy(), poses[:, :3, 1].copy()
        poses[:, :3, 0], poses[:, :3, 1] = c * right + s * down, c * down - s * right
        return poses

    def frames(self, scene: int, count: int, start: int = 0) -> Iterator[Frame]:
        """Views start to start + count - 1 of a scene; view i is always the same."""
        views = range(start, start + count)
        store = self._store(scene)
        for block in store.blocks(views) if store else [views]:
            stored_views = store.load(block) if store else {}
            missing_views = [view for view in block if view not in stored_views]
            if missing_views:
                cameras = [self.camera(scene, view) for view in missing_views]
                frames = self.renderer.frames(self._geometry(scene), cameras)
                new = {
                    view: exact(frame) for view, frame in zip(missing_views, frames, strict=True)
                }
                if store:
                    store.add(block, new)
                stored_views |= new
            for view in block:
                name = f"tabletop/{self.numbers[scene]}/{view}"
                yield stored_views[view].frame(self.camera(scene, view), name)

    def truth(self, scene: int) -> HeightMap:
        """Orthographic heights, colour and labels of the scene; every vertex is seen."""
        store = self._store(scene)
        height_map = store.load_truth(self.grid, self.classes) if store else None
        if height_map is None:
            height_map = self.renderer.height_map(self._geometry(scene), self.grid)
            if store:
                store.add_truth(height_map)
        return height_map

    def _geometry(self, scene: int) -> TabletopGeometry:
        """Keeps the last requested scene and what the renderer made of it."""
        if self._last is None or self._last[0] != scene:
            self._last = (scene, self.scenes.geometry(self.scene(scene)))
        return self._last[1]

    def _store(self, scene: int) -> ViewCache | None:
        if self.cache is not None and scene not in self._stores:
            self._stores[scene] = ViewCache(self.cache / self._key(scene))
        return self._stores.get(scene)

    def _digest(self) -> str:
        """Changes with the generator: the first scene stands for the others."""
        return hashlib.sha256(f"{list(self.numbers)} {self._key(0)}".encode()).hexdigest()

    def _key(self, scene: int) -> str:
        geometry = self._geometry(scene)
        cameras = [self.camera(scene, view) for view in range(3)]  # represents the settings
        settings = [self.renderer.fingerprint(), self.seed, self.numbers[scene]]
        settings += [str((c.width, c.height, c.matrix, c.T_world_camera)) for c in cameras]
        return f"scene_{self.numbers[scene]:05d}_{key_of(geometry, settings)}"


def _require(
    size: Sequence[int], heights: Sequence[float], angles: Sequence[float], limit: int | None
) -> None:
    if len(size) != 2 or min(size) < 1:
        raise ConfigError(f"size = {list(size)}: expected width and height in pixels")
    if not 0 < heights[0] <= heights[1] or not 0 <= angles[0] <= angles[1] < 80:
        raise ConfigError(
            f"heights = {list(heights)} m, angles = {list(angles)} degrees: expected each lowest "
            "first, heights above 0 and angles from 0 to below 80"
        )
    COUNT.require(limit=limit)
