"""Height maps fused from the views of scenes, made once and kept as files."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.labelling_protocols import FrameSource, HeightMapping
from scenefw.core.made_of import settings_of
from scenefw.core.protocols import Noise
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.noise.frames import described, disturb


class FusedMaps:
    """Fuses views to the maps that a map network learns from (thesis 4.6.1).

    Files are named by all that the first and the last view show, by the true map of the whole
    scene, and by all settings of the fusion, so that a folder may serve any number of data sets.

    Args:
        source: the scenes.
        heights: fuses their views.
        frames: views of each scene, or numbers that scenes have in turns.
        folder: keeps the maps; None fuses them every time.
        noise: noises that the views of scenes are fused under in turns, as `in_turns`; None: none.
        seed: of the noise.
    """

    def __init__(
        self,
        source: FrameSource,
        heights: HeightMapping,
        frames: int | Sequence[int] = 200,
        folder: str | Path | None = "outputs/cache/fused_maps",
        noise: Mapping[str, Mapping[str, Noise]] | None = None,
        seed: int = 0,
    ) -> None:
        self.frames = (frames,) if isinstance(frames, int) else tuple(frames)
        if not self.frames or min(self.frames) < 1:
            raise ConfigError(f"maps are fused from frames = {frames}; expected 1 view or more")
        self.source, self.heights = source, heights
        self.folder = None if folder is None else Path(folder)
        self.noise, self.seed = dict(noise or {}), seed

    def __call__(self, scene: int) -> HeightMap:
        """The map of a scene.

        Raises:
            InputError: its file is damaged.
            StorageError: its file can't be written.
        """
        if self.folder is None:
            return self._fuse(scene)
        path = self.folder / f"{self._key(scene)}.npz"
        if not path.exists():
            save_map(path, self._fuse(scene))
        return load_map(path, self.heights.grid).height_map

    def facts(self) -> dict[str, Any]:
        """Number of views and noise of scenes, both in turns."""
        noise = [": ".join([n, *described(noises)]) for n, noises in self.noise.items()]
        return {"frames": list(self.frames), "noise": noise}

    def _fuse(self, scene: int) -> HeightMap:
        running = self.heights.begin()
        noise = in_turns(self.noise, scene)
        for number, frame in enumerate(self.source.frames(scene, self._count(scene))):
            running.add(disturb(frame, noise, self.seed, scene, number))
        return running.height_map()

    def _count(self, scene: int) -> int:
        return self.frames[scene % len(self.frames)]

    def _key(self, scene: int) -> str:
        """Names a map; a single view would show neither the whole scene nor how views go on."""
        noise = in_turns(self.noise, scene)
        count = self._count(scene)
        settings: list[Any] = [count, settings_of(self.heights)]
        if noise:
            noise_settings = [
                [name, settings_of(noise_model)] for name, noise_model in sorted(noise.items())
            ]
            settings += [self.seed, noise_settings]
        digest = hashlib.sha256(json.dumps(settings).encode())
        truth = self.source.truth(scene)
        parts: list[NDArray[Any] | None] = [truth.heights, truth.colour, truth.labels]
        first, last = (next(iter(self.source.frames(scene, 1, start))) for start in (0, count - 1))
        for view in (first, last):
            lens = view.camera
            digest.update(repr((lens.width, lens.height)).encode() + lens.matrix.tobytes())
            parts += [lens.T_world_camera, view.depth, view.colour, view.labels]
        for part in parts:
            digest.update(b"none" if part is None else np.ascontiguousarray(part).tobytes())
        return f"{first.name.replace('/', '_')}_{digest.hexdigest()[:16]}"


def in_turns(noises: Mapping[str, Mapping[str, Noise]], scene: int) -> Mapping[str, Noise]:
    """The noises of a scene when scenes use settings in rotation; none without settings.

    Args:
        noises: settings by any name, each of noises by name.
        scene: takes the setting number scene modulo their number.
    """
    return list(noises.values())[scene % len(noises)] if noises else {}
