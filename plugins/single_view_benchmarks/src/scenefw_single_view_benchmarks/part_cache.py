"""Convex parts of meshes in the user's cache, as finding them takes long."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np

from scenefw.core.cache_folder import cache_folder
from scenefw.core.errors import StorageError
from scenefw.core.files import DAMAGED, replacing
from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts

_VERSION = 1


class PartCache:
    """Divides meshes like `parts`, each only once on a machine.

    Args:
        parts: divides.
        folder: of the files; None: the cache, if one can be written.
    """

    def __init__(self, parts: ConvexParts, folder: Path | None = None) -> None:
        self.parts = parts
        cache = cache_folder()
        self.folder = folder or (None if cache is None else cache / "scenefw" / "parts")

    def of(self, mesh: TriangleMesh) -> tuple[Float64, ...]:
        """Corners (K, 3) of each part, exact in float32; as `ConvexParts.of`."""
        path = None if self.folder is None else self.folder / f"{self._key(mesh)}.npz"
        parts = None if path is None else _read_parts(path)
        if parts is None:
            parts = tuple(
                part.astype(np.float32).astype(np.float64) for part in self.parts.of(mesh)
            )
            if parts and path is not None:
                _write_parts(path, parts)
        return parts

    def _key(self, mesh: TriangleMesh) -> str:
        digest = hashlib.sha256(f"{_VERSION} {sorted(vars(self.parts).items())}".encode())
        digest.update(np.ascontiguousarray(mesh.vertices).tobytes())
        digest.update(np.ascontiguousarray(mesh.faces).tobytes())
        return digest.hexdigest()[:24]


def _read_parts(path: Path) -> tuple[Float64, ...] | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            return tuple(file[name].astype(np.float64) for name in sorted(file.files))
    except DAMAGED:
        return None  # none yet, or damaged: found anew


def _write_parts(path: Path, parts: tuple[Float64, ...]) -> None:
    arrays = {f"part_{i:03d}": part.astype(np.float32) for i, part in enumerate(parts)}
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]
    except (OSError, StorageError):
        return  # a cache that can't be written costs time alone
