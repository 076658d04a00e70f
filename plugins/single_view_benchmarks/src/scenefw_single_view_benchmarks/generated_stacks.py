"""Scenes that a generator makes when they are first asked for."""

from __future__ import annotations

import hashlib
import json
import threading
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.cache_folder import cache_folder
from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.made_of import settings_of
from scenefw.core.settings import COUNT
from scenefw.core.versions import installed
from scenefw.representations.mesh_volumes import SolidScenes
from scenefw.scenes.storage import load_scenes, pack, save_scenes

if TYPE_CHECKING:
    from pathlib import Path

    import torch
    from torch import Tensor

    from scenefw.core.protocols import SceneSource
    from scenefw.core.types import Scene, SceneObject

_ATTEMPTS = 200  # for one scene
_SIMULATORS = ("scenefw", "pybullet", "mujoco", "coacd", "numpy", "scipy")


class GeneratedStacks:
    """The first scenes of a generator: number i depends on the seed and on i alone.

    They are kept in the user's cache, in a folder named after all that decides what comes out.

    Args:
        source: makes them.
        count: of scenes.
        seed: of the data set.
        folder: of the kept scenes; None: in the user's cache.

    Raises:
        ConfigError: fewer than one scene.
    """

    def __init__(
        self, source: SceneSource, count: int, seed: int = 0, folder: Path | None = None
    ) -> None:
        COUNT.require(count=count)
        self.source, self.seed = source, seed
        self.indices = np.arange(count)
        self._folder = folder
        self._scenes: dict[int, Scene] = {}
        self._lock = threading.Lock()  # an engine holds one world

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.indices)

    def objects(self, row: int) -> tuple[SceneObject, ...]:
        """The objects of a scene, as rigid bodies.

        Raises:
            ConfigError: no attempt at the scene succeeded.
        """
        with self._lock:
            if row not in self._scenes:
                self._scenes[row] = self._stored(row) or self._generated(row)
            return self._scenes[row].objects

    def parameters(
        self, indices: Tensor | list[int], device: torch.device | str | None = None
    ) -> SolidScenes:
        """The scenes at some positions; their volumes will be on `device`."""
        return SolidScenes.of([self.objects(int(row)) for row in indices], device)

    @cached_property
    def _cache(self) -> Path | None:
        if self._folder is not None:
            return self._folder
        facts = [settings_of(self.source), self.seed, installed(_SIMULATORS)]
        digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]
        cache = cache_folder()
        return None if cache is None else cache / "scenefw" / "stacks" / digest

    def _stored(self, row: int) -> Scene | None:
        if self._cache is None or not self._path(self._cache, row).is_file():
            return None
        try:
            return load_scenes(self._path(self._cache, row)).scene(0, self.seed)
        except StorageError:
            return None  # damaged: made anew

    def _generated(self, row: int) -> Scene:
        numbers = range(row * _ATTEMPTS, (row + 1) * _ATTEMPTS)
        attempts = (self.source.generate(number, self.seed) for number in numbers)
        scene = next((scene for scene in attempts if scene is not None), None)
        if scene is None:
            raise ConfigError(
                f"none of {_ATTEMPTS} attempts at scene {row} came to rest; give more room "
                "(scene.lower, scene.upper) or fewer objects (scene.minimum)"
            )
        if self._cache is not None:
            self._write(self._cache, row, scene)
        return scene

    def _write(self, folder: Path, row: int, scene: Scene) -> None:
        facts: dict[str, Any] = {"seed": self.seed, "number": row}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            save_scenes(self._path(folder, row), pack([scene]), facts)
        except (OSError, StorageError):
            return  # a cache that can't be written costs time alone

    @staticmethod
    def _path(folder: Path, row: int) -> Path:
        return folder / f"{row:06d}.npz"
