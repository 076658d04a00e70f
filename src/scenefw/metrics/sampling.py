"""Points spread uniformly over the area of triangle meshes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.types import TriangleMesh

Float64 = NDArray[np.float64]


class SurfacePoints(NamedTuple):
    """Points (P, 3) on a surface in metres, and the unit normals (P, 3) of their faces."""

    points: Float64
    normals: Float64


def face_areas(mesh: TriangleMesh) -> Float64:
    """Area of each face (F,) in m^2."""
    first, second, third = np.moveaxis(mesh.vertices.take(mesh.faces, axis=0), 1, 0)
    x, y, z = np.cross(second - first, third - first).T
    return np.asarray(np.sqrt(x * x + y * y + z * z) / 2)  # faster than a norm of rows


def sample_surface(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> SurfacePoints:
    """Independent points, uniform by area.

    Raises:
        InputError: the mesh has no area.
    """
    import trimesh

    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    if not surface.area > 0:
        raise InputError("a mesh without area cannot be sampled; give one with triangles")
    points, faces = trimesh.sample.sample_surface(surface, count, seed=rng)
    return SurfacePoints(points, surface.face_normals[faces])


def faces_of(mesh: TriangleMesh, face_mask: NDArray[np.bool_]) -> TriangleMesh:
    """The mesh with the chosen faces alone; vertices are kept as they are."""
    return TriangleMesh(mesh.vertices, mesh.faces[face_mask])
