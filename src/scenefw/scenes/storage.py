"""Scenes as one compressed file of parameters, with a manifest beside it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.array_files import write_arrays
from scenefw.core.errors import StorageError
from scenefw.core.files import DAMAGED, unreadable, utf8_text, write_text
from scenefw.core.types import Float32, Int32, Pose, Scene, SceneObject
from scenefw.scenes.mesh_storage import StoredMeshScenes, concatenate_meshes, pack_meshes
from scenefw.scenes.splits import SPLITS, split_of
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric

UInt8 = NDArray[np.uint8]

_FORMAT = 2
_READ = (1, 2)  # the first lacks the manifest's `shapes`, and the part `final`


@dataclass(frozen=True, eq=False)
class StoredScenes:
    """S scenes of up to N superquadrics; rows beyond `count` are harmless fillers.

    Args:
        half_axes: (S, N, 3) float32 metres.
        exponents: (S, N, 3) float32, r, s, t of eq. 5.1.
        positions: (S, N, 3) float32 metres, world.
        quaternions: (S, N, 4) float32 (w, x, y, z), object to world.
        masses: (S, N) float32 kilograms.
        count: (S,) uint8, objects of each scene.
        index: (S,) int32, number of the attempt that made the scene.
        split: (S,) uint8, position in `SPLITS`.
    """

    half_axes: Float32
    exponents: Float32
    positions: Float32
    quaternions: Float32
    masses: Float32
    count: UInt8
    index: Int32
    split: UInt8

    def __len__(self) -> int:
        return len(self.count)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def shapes(self, split: str) -> set[bytes]:
        """The shapes of a part: half-axes and exponents as bytes, to be compared exactly."""
        rows = self.split == SPLITS.index(split)
        present_mask = np.arange(self.masses.shape[1]) < self.count[rows, None]
        parameters = np.concatenate(
            [self.half_axes[rows][present_mask], self.exponents[rows][present_mask]], axis=-1
        )
        return {row.tobytes() for row in parameters}

    def scene(self, row: int, seed: int = 0) -> Scene:
        """One scene as objects."""
        objects = tuple(
            SceneObject(
                Superquadric(
                    self.half_axes[row, i].astype(np.float64),
                    self.exponents[row, i].astype(np.float64),
                ),
                Pose(
                    self.positions[row, i].astype(np.float64),
                    self.quaternions[row, i].astype(np.float64),
                ),
                float(self.masses[row, i]),
            )
            for i in range(self.count[row])
        )
        return Scene(objects, int(self.index[row]), seed, SPLITS[self.split[row]])


Stored = StoredScenes | StoredMeshScenes
"""Scenes of superquadrics or of meshes."""


def pack(scenes: Sequence[Scene]) -> Stored:
    """Scenes of superquadrics, or of meshes, as arrays.

    Raises:
        StorageError: a scene holds a shape that is neither, or scenes hold both.
    """
    if any(isinstance(item.shape, SolidMesh) for scene in scenes for item in scene.objects):
        return pack_meshes(scenes)
    max_objects = max((len(scene.objects) for scene in scenes), default=0)
    stored = _fillers(len(scenes), max_objects)
    for row, scene in enumerate(scenes):
        stored.count[row] = len(scene.objects)
        stored.index[row] = scene.index
        stored.split[row] = SPLITS.index(scene.split or split_of(scene.seed, scene.index))
        for i, item in enumerate(scene.objects):
            if not isinstance(item.shape, Superquadric):
                raise StorageError(
                    f"scene {scene.index} holds a {type(item.shape).__name__}; "
                    "scenes are stored of superquadrics alone or of meshes alone"
                )
            stored.half_axes[row, i] = item.shape.half_axes
            stored.exponents[row, i] = item.shape.exponents
            stored.positions[row, i] = item.pose.position
            stored.quaternions[row, i] = item.pose.quaternion
            stored.masses[row, i] = item.mass
    return stored


def concatenate(parts: Iterable[Stored]) -> Stored:
    """All scenes of several files, ordered by index.

    Raises:
        StorageError: some are of superquadrics, others of meshes.
    """
    part_list = list(parts)
    meshes = [part for part in part_list if isinstance(part, StoredMeshScenes)]
    superquadrics = [part for part in part_list if isinstance(part, StoredScenes)]
    if meshes and any(len(part) for part in superquadrics):
        raise StorageError("scenes of superquadrics and of meshes can't be in one file")
    return concatenate_meshes(meshes) if meshes else _concatenated(superquadrics)


def _concatenated(parts: Sequence[StoredScenes]) -> StoredScenes:
    total = sum(len(part) for part in parts)
    max_objects = max((part.masses.shape[1] for part in parts), default=0)
    merged, start = _fillers(total, max_objects), 0
    for part in parts:
        rows = slice(start, start + len(part))
        for name, array in merged.arrays().items():
            values = part.arrays()[name]
            array[(rows, slice(values.shape[1])) if values.ndim > 1 else rows] = values
        start += len(part)
    order = np.argsort(merged.index, kind="stable")
    return StoredScenes(**{name: array[order] for name, array in merged.arrays().items()})


def save_scenes(path: Path | str, stored: Stored, facts: Mapping[str, Any]) -> Path:
    """Writes the arrays (.npz) and, beside them, a manifest (.json) of `facts` and check sums.

    The manifest goes last, so a file with a manifest is whole.

    Raises:
        StorageError: the folder can't be written.
    """
    path = Path(path)
    write_arrays(path, stored.arrays(), compact=True)
    manifest = {
        "format": _FORMAT,
        "scenes": len(stored),
        "objects": _tally(stored.count),
        "split": {name: int((stored.split == i).sum()) for i, name in enumerate(SPLITS)},
        "shapes": _shape_counts(stored),
        **facts,
        "arrays": {
            name: {"dtype": str(a.dtype), "shape": list(a.shape), "sha256": _digest(a)}
            for name, a in stored.arrays().items()
        },
    }
    write_text(path.with_suffix(".json"), json.dumps(manifest, indent=2) + "\n")
    return path


def load_scenes(path: Path | str) -> Stored:
    """Reads scenes of superquadrics or of meshes; checked against the manifest where there is one.

    Raises:
        StorageError: missing, damaged, of another format, or not what the manifest says.
    """
    path = Path(path)
    try:
        with np.load(path, allow_pickle=False) as file:
            kind: type[Stored] = StoredMeshScenes if "mesh" in file.files else StoredScenes
            arrays = {field.name: file[field.name] for field in fields(kind)}
    except FileNotFoundError as error:
        raise StorageError(f"no scenes at {path}; make them with run=generate") from error
    except KeyError as error:
        raise StorageError(f"{path} holds no scenes: {error.args[0]}") from error
    except DAMAGED as error:
        raise StorageError(
            f"{path} is damaged or not an .npz file ({unreadable(error)}); regenerate it with "
            "run=generate"
        ) from error
    if kind is StoredScenes:
        _check_layout(path, arrays)
    if path.with_suffix(".json").exists():
        _check_manifest(path, arrays)
    return kind(**arrays)


def load_manifest(path: Path | str) -> dict[str, Any]:
    """The manifest beside a scene file.

    Raises:
        StorageError: missing or damaged.
    """
    source = Path(path).with_suffix(".json")
    try:
        manifest: dict[str, Any] = json.loads(utf8_text(source))
    except (OSError, ValueError) as error:
        raise StorageError(f"manifest {source} is missing or damaged: {error}") from error
    return manifest


def _fillers(scenes: int, objects: int) -> StoredScenes:
    shape = (scenes, objects)
    quaternions = np.zeros((*shape, 4), dtype=np.float32)
    quaternions[..., 0] = 1
    return StoredScenes(
        half_axes=np.full((*shape, 3), 0.05, dtype=np.float32),
        exponents=np.full((*shape, 3), 2, dtype=np.float32),
        positions=np.zeros((*shape, 3), dtype=np.float32),
        quaternions=quaternions,
        masses=np.zeros(shape, dtype=np.float32),
        count=np.zeros(scenes, dtype=np.uint8),
        index=np.zeros(scenes, dtype=np.int32),
        split=np.zeros(scenes, dtype=np.uint8),
    )


def _check_layout(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    scenes, objects = (*arrays["masses"].shape, 0, 0)[:2]
    for name, expected in _fillers(scenes, objects).arrays().items():
        array = arrays[name]
        if array.shape != expected.shape or array.dtype != expected.dtype:
            raise StorageError(
                f"{path}: {name} is {array.dtype} {array.shape}, expected {expected.dtype} "
                f"{expected.shape}; regenerate the file with run=generate"
            )
        if not np.isfinite(array).all():
            raise StorageError(
                f"{path}: {name} holds values that are not finite; regenerate it with run=generate"
            )
    if (arrays["count"] > objects).any():
        raise StorageError(f"{path}: a scene counts more objects than it has rows ({objects})")


def _check_manifest(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    manifest = load_manifest(path)
    if manifest.get("format") not in _READ:
        raise StorageError(
            f"{path} has format {manifest.get('format')}, this version reads "
            f"{' and '.join(map(str, _READ))}; regenerate it with run=generate"
        )
    for name, array in arrays.items():
        if manifest.get("arrays", {}).get(name, {}).get("sha256") != _digest(array):
            raise StorageError(
                f"{path}: {name} is not what {path.with_suffix('.json').name} says; "
                "fetch both again or regenerate them with run=generate"
            )


def _shape_counts(stored: Stored) -> dict[str, int]:
    """Distinct shapes of each part, and how many are in more than one (`shared`)."""
    parts = [stored.shapes(name) for name in SPLITS]
    counts = {name: len(part) for name, part in zip(SPLITS, parts, strict=True)}
    return counts | {"shared": sum(counts.values()) - len(set().union(*parts))}


def _tally(count: UInt8) -> dict[str, int]:
    values, times = np.unique(count, return_counts=True)
    return {str(value): int(n) for value, n in zip(values, times, strict=True)}


def _digest(array: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(array).tobytes()).hexdigest()
