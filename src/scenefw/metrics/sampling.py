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
    return 0.5 * np.linalg.norm(_crosses(mesh), axis=1)


def sample_surface(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> SurfacePoints:
    """Independent points, uniform by area.

    Raises:
        InputError: the mesh has no area.
    """
    crosses = _crosses(mesh)
    doubled = np.linalg.norm(crosses, axis=1)
    total = np.cumsum(doubled)
    if not len(total) or total[-1] <= 0:
        raise InputError("a mesh without area cannot be sampled; give one with triangles")
    faces = np.searchsorted(total, rng.random(count) * total[-1], side="right")
    faces = np.minimum(faces, len(total) - 1)
    corners = mesh.vertices[mesh.faces[faces]]
    u, v = rng.random((2, count, 1))
    outside = u + v > 1  # the other half of the parallelogram is folded back
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    edges = corners[:, 1:] - corners[:, :1]
    points = corners[:, 0] + u * edges[:, 0] + v * edges[:, 1]
    return SurfacePoints(points, crosses[faces] / doubled[faces, None])


def faces_of(mesh: TriangleMesh, chosen: NDArray[np.bool_]) -> TriangleMesh:
    """The mesh with the chosen faces alone; vertices are kept as they are."""
    return TriangleMesh(mesh.vertices, mesh.faces[chosen])


def _crosses(mesh: TriangleMesh) -> Float64:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.cross(b - a, c - a)
