"""Scenes of meshes to test on, made by `run=generate scene=mesh_stacks`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from scenefw.core.errors import StorageError
from scenefw.core.types import SceneObject
from scenefw.data.batches.stacks import SceneSet, StackScenes, data_file, require_open, rows_of
from scenefw.representations.mesh_volumes import SolidScenes
from scenefw.scenes.mesh_storage import StoredMeshScenes
from scenefw.scenes.storage import load_scenes


class MeshStacks:
    """Scenes of meshes of one split.

    Args:
        path: file of `run=generate`.
        split: train, val, test or all; generators of meshes make test scenes.
        limit: at most this many scenes, the first of the split; None means all.

    Raises:
        StorageError: the file is missing, damaged or holds no meshes.
        ConfigError: no such split, it holds no scene, a limit below 1, or final is not open.
    """

    def __init__(self, path: Path | str, split: str = "test", limit: int | None = None) -> None:
        require_open(Path(path), split)
        stored = load_scenes(path)
        if not isinstance(stored, StoredMeshScenes):
            raise StorageError(f"{path} holds no scenes of meshes; give one of scene=mesh_stacks")
        self.split = split
        self._rows = rows_of(stored.split, split, limit, Path(path))
        self._stored = stored
        self.indices = stored.index[self._rows]

    def __len__(self) -> int:
        """Scenes of the split."""
        return len(self._rows)

    def objects(self, row: int) -> tuple[SceneObject, ...]:
        """The objects of the scene at a position in this split, as rigid bodies."""
        return self._stored.scene(int(self._rows[row])).objects

    def parameters(
        self, indices: Tensor | list[int], device: torch.device | str | None = None
    ) -> SolidScenes:
        """The scenes of the given positions in this split; their volumes will be on `device`."""
        rows = torch.as_tensor(indices, dtype=torch.int64).tolist()
        return SolidScenes.of([self.objects(row) for row in rows], device)


def scene_set(
    path: Path | str | None = None, split: str = "train", limit: int | None = None
) -> SceneSet:
    """Scenes of a file, of superquadrics or of meshes, or a data set that ships, by its name.

    Args:
        path: a file, a list of files, or names of data sets; None means stacks.
        split: train, val, test, all of these, or final.
        limit: at most this many scenes of each data set; None means all.

    Raises:
        StorageError: the file is missing, damaged or no data set of scenes.
        ConfigError: no such split, or it holds no scene.
    """
    if isinstance(path, (str, Path)) and _of_meshes(data_file(path)):
        return MeshStacks(path, split, limit)
    return StackScenes(path, split, limit)


def _of_meshes(path: Path) -> bool:
    try:
        with np.load(path, allow_pickle=False) as file:
            return "mesh" in file.files
    except Exception:  # noqa: BLE001 - reading the scenes says what is wrong
        return False
