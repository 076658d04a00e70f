"""Scenes of meshes as arrays: which mesh, where, and each mesh once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import StorageError
from scenefw.core.types import Float32, Int32, Pose, Scene, SceneObject
from scenefw.scenes.splits import SPLITS, split_of
from scenefw.shapes.solid_mesh import SolidMesh

UInt8 = NDArray[np.uint8]
Int64 = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class StoredMeshScenes:
    """S scenes of up to N of M meshes; rows beyond `count` are fillers.

    Args:
        mesh: (S, N) int32, number of the mesh.
        positions: (S, N, 3) float32 metres, world.
        quaternions: (S, N, 4) float32 (w, x, y, z), object to world.
        masses: (S, N) float32 kilograms.
        count: (S,) uint8, objects of each scene.
        index: (S,) int32, number of the attempt that made the scene.
        split: (S,) uint8, position in `SPLITS`.
        names: (M,) of the meshes.
        vertices: (V, 3) float32, of all meshes in their own frames (m).
        faces: (F, 3) int32, corners counted within each mesh.
        corners: (K, 3) float32, of all convex parts of all meshes (m).
        ends: (M, 2) int64, where the vertices and the faces of each mesh end.
        parts: (P, 2) int64: mesh of each convex part, and where its corners end.
    """

    mesh: Int32
    positions: Float32
    quaternions: Float32
    masses: Float32
    count: UInt8
    index: Int32
    split: UInt8
    names: NDArray[np.str_]
    vertices: Float32
    faces: Int32
    corners: Float32
    ends: Int64
    parts: Int64

    def __len__(self) -> int:
        return len(self.count)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def shapes(self, split: str) -> set[bytes]:
        """The meshes of a part, by name."""
        rows = self.split == SPLITS.index(split)
        present_mask = np.arange(self.mesh.shape[1]) < self.count[rows, None]
        return {str(self.names[i]).encode() for i in np.unique(self.mesh[rows][present_mask])}

    def scene(self, row: int, seed: int = 0) -> Scene:
        """One scene as objects."""
        items = tuple(
            SceneObject(
                self.solids[self.mesh[row, i]],
                Pose(
                    self.positions[row, i].astype(np.float64),
                    self.quaternions[row, i].astype(np.float64),
                ),
                float(self.masses[row, i]),
            )
            for i in range(self.count[row])
        )
        return Scene(items, int(self.index[row]), seed, SPLITS[self.split[row]])

    @cached_property
    def solids(self) -> tuple[SolidMesh, ...]:
        """The meshes as solids."""
        starts = np.vstack([np.zeros((1, 2), np.int64), self.ends])
        corner_starts = [0, *self.parts[:, 1]]
        solids = []
        for i, name in enumerate(self.names):
            (v0, f0), (v1, f1) = starts[i], starts[i + 1]
            parts = tuple(
                self.corners[corner_starts[k] : self.parts[k, 1]].astype(np.float64)
                for k in np.flatnonzero(self.parts[:, 0] == i)
            )
            vertices = self.vertices[v0:v1].astype(np.float64)
            solids.append(SolidMesh(vertices, self.faces[f0:f1].astype(np.int64), parts, str(name)))
        return tuple(solids)


def pack_meshes(scenes: Sequence[Scene]) -> StoredMeshScenes:
    """Scenes of meshes as arrays.

    Raises:
        StorageError: a scene holds a shape that is no mesh, or two meshes have one name.
    """
    library: dict[str, SolidMesh] = {}
    for scene in scenes:
        for item in scene.objects:
            if not isinstance(item.shape, SolidMesh):
                raise StorageError(
                    f"scene {scene.index} holds a {type(item.shape).__name__} beside meshes; "
                    "generate scenes of one kind of shapes"
                )
            solid = library.setdefault(item.shape.name, item.shape)
            if not np.array_equal(solid.vertices, item.shape.vertices):
                raise StorageError(f"two different meshes have the name {item.shape.name!r}")
    return _stored(scenes, dict(sorted(library.items())))


def _stored(scenes: Sequence[Scene], library: dict[str, SolidMesh]) -> StoredMeshScenes:
    max_objects = max((len(scene.objects) for scene in scenes), default=0)
    shape = (len(scenes), max_objects)
    rows = {name: i for i, name in enumerate(library)}
    mesh, masses = np.zeros(shape, np.int32), np.zeros(shape, np.float32)
    positions = np.zeros((*shape, 3), np.float32)
    quaternions = np.zeros((*shape, 4), np.float32)
    quaternions[..., 0] = 1
    for row, scene in enumerate(scenes):
        for i, item in enumerate(scene.objects):
            mesh[row, i] = rows[item.shape.name]  # type: ignore[attr-defined]
            positions[row, i], quaternions[row, i] = item.pose.position, item.pose.quaternion
            masses[row, i] = item.mass
    splits = [SPLITS.index(s.split or split_of(s.seed, s.index)) for s in scenes]
    return StoredMeshScenes(
        mesh, positions, quaternions, masses,
        np.array([len(s.objects) for s in scenes], np.uint8),
        np.array([s.index for s in scenes], np.int32),
        np.array(splits, np.uint8),
        **_packed(list(library.values())),
    )  # fmt: skip


def _packed(solids: Sequence[SolidMesh]) -> dict[str, Any]:
    owners = [(i, part) for i, solid in enumerate(solids) for part in solid.parts]
    counts = np.array([(len(solid.vertices), len(solid.faces)) for solid in solids], np.int64)
    sizes = np.cumsum([len(part) for _, part in owners], dtype=np.int64)
    numbers = np.array([i for i, _ in owners], np.int64)
    return {
        "names": np.array([solid.name for solid in solids], dtype=np.str_),
        "vertices": _concatenate([solid.vertices for solid in solids], np.float32),
        "faces": _concatenate([solid.faces for solid in solids], np.int32),
        "corners": _concatenate([part for _, part in owners], np.float32),
        "ends": counts.reshape(-1, 2).cumsum(axis=0),
        "parts": np.column_stack([numbers, sizes]).reshape(-1, 2).astype(np.int64),
    }


def _concatenate(arrays: Sequence[NDArray[Any]], kind: type) -> NDArray[Any]:
    return np.concatenate([np.zeros((0, 3)), *arrays]).astype(kind)


def concatenate_meshes(stored: Sequence[StoredMeshScenes], seed: int = 0) -> StoredMeshScenes:
    """All scenes of several files, ordered by index."""
    scenes = [part.scene(row, seed) for part in stored for row in range(len(part))]
    return pack_meshes(sorted(scenes, key=lambda scene: scene.index))
