"""Height maps fused from the views of scenes, made once and kept as files."""

import hashlib
from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.protocols import FrameSource, HeightMapping
from scenefw.core.types import Frame
from scenefw.data.height_maps import load_map, save_map


class FusedMaps:
    """Fuses views at their true poses to the maps that a map network learns from (thesis 4.6.1).

    Files are named by the first view and by all settings of the fusion, so that a folder may serve
    any number of data sets.

    Args:
        source: the scenes.
        heights: fuses their views.
        frames: views of each scene.
        folder: keeps the maps; None fuses them every time.
    """

    def __init__(
        self,
        source: FrameSource,
        heights: HeightMapping,
        frames: int = 200,
        folder: str | Path | None = "outputs/cache/fused_maps",
    ) -> None:
        if frames < 1:
            raise ConfigError(f"maps are fused from frames = {frames}; expected 1 view or more")
        self.source, self.heights, self.frames = source, heights, frames
        self.folder = None if folder is None else Path(folder)

    def __call__(self, scene: int) -> HeightMap:
        """The map of a scene.

        Raises:
            InputError: its file is damaged.
            StorageError: its file can't be written.
        """
        if self.folder is None:
            return self._fuse(scene)
        path = self.folder / f"{self._key(next(iter(self.source.frames(scene, 1))))}.npz"
        if not path.exists():
            save_map(path, self._fuse(scene))
        return load_map(path, self.heights.grid).height_map

    def _fuse(self, scene: int) -> HeightMap:
        running = self.heights.begin()
        for frame in self.source.frames(scene, self.frames):
            running.add(frame)
        return running.height_map()

    def _key(self, first: Frame) -> str:
        settings = sorted((name, repr(value)) for name, value in vars(self.heights).items())
        digest = hashlib.sha256(f"{self.frames} {type(self.heights).__name__} {settings}".encode())
        digest.update(first.camera.T_world_camera.tobytes() + first.depth.tobytes())
        return f"{first.name.replace('/', '_')}_{digest.hexdigest()[:16]}"
