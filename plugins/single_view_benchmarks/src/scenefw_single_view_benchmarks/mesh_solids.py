"""Solids from a folder of meshes, to stack."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts
from scenefw.shapes.solid_mesh import SolidMesh, closed, solid
from scenefw_single_view_benchmarks.part_cache import PartCache

_SUFFIXES = {".ply", ".obj", ".stl", ".off", ".glb"}
_SIZES = (0.005, 1.0)  # m: of the longest side of anything on a table


class MeshSolids:
    """The meshes of a folder as solids, in metres, exact in float32.

    They are a test domain: scenes of them belong to the part `test`. Meshes are read when first
    needed; their convex parts are kept in the user's cache, as finding them takes long.

    Args:
        root: folder, searched with its subfolders.
        names: patterns (regular expressions) of paths relative to the root, without suffix; a mesh
            that none of them matches is left out. None takes all.
        leave_out: pattern of paths to leave out, or None.
        scale: metres per unit of the files.
        longest: meshes with a longer side are left out (m).
        shortest: meshes whose longest side is shorter are left out (m).
        parts: divides meshes into convex parts; None: they collide as their convex hulls.

    Raises:
        ConfigError: no root is given, or the scale isn't positive.
        InputError: the folder is missing, or holds no mesh that is wanted.
    """

    def __init__(
        self,
        root: str | None,
        names: list[str] | None = None,
        leave_out: str | None = None,
        scale: float = 1.0,
        longest: float = 0.3,
        shortest: float = 0.03,
        parts: ConvexParts | None = None,
    ) -> None:
        if root is None:
            raise ConfigError("stacks of meshes need a folder of them; give shape.root=FOLDER")
        if not scale > 0:
            raise ConfigError(f"shape.scale is {scale}; expected metres per unit, above 0")
        self.root, self.names, self.leave_out = str(root), names, leave_out
        self.scale, self.longest, self.shortest, self.parts = scale, longest, shortest, parts
        self._files = _files(Path(root), names, leave_out)
        self._solids: dict[str, SolidMesh | None] = {}

    def sample(self, rng: np.random.Generator, split: str) -> SolidMesh:
        """One mesh of the folder, all equally likely.

        Raises:
            ConfigError: the part isn't `test`.
            InputError: a mesh is unusable, or all are too long or too short.
        """
        if split != "test":
            raise ConfigError(
                f"real meshes are for tests, not for the part {split}; give scene.split=test"
            )
        names = sorted(self._files)
        while names:
            solid_mesh = self.solid(names.pop(int(rng.integers(len(names)))))
            if solid_mesh is not None:
                return solid_mesh
        raise InputError(
            f"no mesh in {self.root} is {self.shortest} to {self.longest} m long; give "
            "shape.scale=METRES_PER_UNIT, or other shape.shortest and shape.longest"
        )

    def solid(self, name: str) -> SolidMesh | None:
        """A mesh by its path relative to the root, without suffix; None if too long or too short.

        Raises:
            InputError: it is unusable.
        """
        if name not in self._solids:
            self._solids[name] = self._read_solid(name)
        return self._solids[name]

    def _read_solid(self, name: str) -> SolidMesh | None:
        path = self._files[name]
        try:
            mesh = read_closed(path)
        except InputError as error:
            raise InputError(self._about_all(str(error))) from error
        mesh = TriangleMesh(mesh.vertices * self.scale, mesh.faces)
        size = float(np.ptp(mesh.vertices, axis=0).max())
        if not _SIZES[0] <= size <= _SIZES[1]:
            raise InputError(
                f"mesh {path} would be {size:.4g} m long with shape.scale={self.scale:g}; "
                f"{self._other_unit(size)}take it out with {_without(name)}"
            )
        if not self.shortest <= size <= self.longest:
            return None
        try:
            shape = solid(mesh).shape
        except InputError as error:
            raise InputError(f"mesh {path}: {error}; take it out with {_without(name)}") from error
        vertices = shape.mesh().vertices.astype(np.float32).astype(np.float64)
        solid_mesh = SolidMesh(vertices, mesh.faces, name=name)
        return replace(solid_mesh, parts=self._parts(solid_mesh))

    def _other_unit(self, size: float) -> str:
        """Asks for the scale of another unit, if a mesh of this size (m) fits a table in it."""
        for factor in (1e-3, 1e3, 1e-2, 1e2):
            if self.shortest <= size * factor <= self.longest:
                return (
                    f"give the metres of its unit, maybe shape.scale={self.scale * factor:g}, or "
                )
        return ""

    def _about_all(self, first: str) -> str:
        """What is wrong with a mesh, and with others, so that one look at the folder is enough."""
        bad = [name for name, path in self._files.items() if not _is_closed(path)]
        if len(bad) < 2:
            return first
        patterns = [self.leave_out] if self.leave_out else []
        patterns += [f"^{re.escape(name)}$" for name in bad]
        return (
            f"{len(bad)} of {len(self._files)} meshes in {self.root} can't be read or are not "
            f"closed, so they have no inside; close them, or take them out with "
            f"'shape.leave_out=\"{'|'.join(patterns)}\"'"
        )

    def _parts(self, solid_mesh: SolidMesh) -> tuple[Float64, ...]:
        return PartCache(self.parts).of(solid_mesh.mesh()) if self.parts else ()


def read_closed(path: Path) -> TriangleMesh:
    """The surface in a file, equal vertices joined, faces outward.

    Raises:
        InputError: it can't be read, is empty or isn't closed.
    """
    import trimesh

    try:
        mesh = trimesh.load(path, force="mesh")
    except Exception as error:  # trimesh passes on whatever its readers raise
        raise InputError(
            f"mesh {path} can't be read ({error}); take it out with {_without(path.stem)}"
        ) from error
    if not isinstance(mesh, trimesh.Trimesh) or not len(mesh.faces):
        raise InputError(f"mesh {path} holds no triangles; take it out with {_without(path.stem)}")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    mesh.update_faces(mesh.nondegenerate_faces())
    if mesh.is_watertight and mesh.volume < 0:
        mesh.invert()
    surface = TriangleMesh(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64))
    if not closed(surface):
        raise InputError(
            f"mesh {path} is not closed, so it has no inside; close it, or take it out with "
            f"{_without(path.stem)}"
        )
    return surface


def _is_closed(path: Path) -> bool:
    try:
        read_closed(path)
    except InputError:
        return False
    return True


def _without(name: str) -> str:
    return f"shape.leave_out={name}"


def _files(root: Path, names: list[str] | None, leave_out: str | None) -> dict[str, Path]:
    if not root.is_dir():
        raise InputError(f"there is no folder {root}; give shape.root=FOLDER of meshes")
    paths = {}
    for path in sorted(root.rglob("*")):
        name = path.relative_to(root).with_suffix("").as_posix()
        is_selected = names is None or any(re.search(pattern, name) for pattern in names)
        is_excluded = leave_out is not None and re.search(leave_out, name)
        if path.suffix.lower() in _SUFFIXES and is_selected and not is_excluded:
            paths[name] = path
    if not paths:
        raise InputError(
            f"{root} holds no mesh ({', '.join(sorted(_SUFFIXES))}) that shape.names and "
            "shape.leave_out let pass; give another shape.root or other patterns"
        )
    return paths
