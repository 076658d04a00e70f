"""Solids given by watertight meshes, which collide as convex parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Float64, PlacedShape, TriangleMesh
from scenefw.shapes.moments import Moments, moments

Divide = Callable[[TriangleMesh], tuple[Float64, ...]]
"""From a mesh to the corners (K, 3) of each of its convex parts."""

_LEAST = 1e-8  # m^3: a cube of 2 mm


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """A watertight mesh, its centre of mass at the origin, its principal axes along x, y, z.

    Args:
        vertices: (V, 3) m.
        faces: (F, 3), counter-clockwise from outside.
        parts: corners (K, 3) of the convex parts that it collides as (m); none: its convex hull.
        name: of where it comes from; empty if it has none.
    """

    vertices: Float64
    faces: NDArray[np.int64]
    parts: tuple[Float64, ...] = ()
    name: str = ""

    def mesh(self) -> TriangleMesh:
        """Its surface."""
        return TriangleMesh(self.vertices, self.faces)

    def volume(self) -> float:
        """Volume inside the surface (m^3)."""
        return self._moments.volume

    def inertia(self) -> Float64:
        """Principal moments of inertia (3,) about x, y, z per unit mass (m^2)."""
        return np.asarray(self._moments.spread.sum() - self._moments.spread)

    @cached_property
    def _moments(self) -> Moments:
        return moments(self.mesh())


def solid(mesh: TriangleMesh, divide: Divide | None = None) -> PlacedShape:
    """The solid inside a mesh, and where it is.

    Args:
        mesh: watertight, in world coordinates (m).
        divide: into convex parts; None: it collides as its convex hull.

    Raises:
        InputError: the mesh is not closed, or holds no volume.
    """
    if not closed(mesh):
        raise InputError("its surface is not closed")
    mesh_moments = moments(mesh)
    if not mesh_moments.volume > _LEAST:
        raise InputError("it holds no volume")
    local_mesh = TriangleMesh(
        transform_points(inverse(mesh_moments.pose.matrix), mesh.vertices), mesh.faces
    )
    return PlacedShape(
        SolidMesh(local_mesh.vertices, local_mesh.faces, divide(local_mesh) if divide else ()),
        mesh_moments.pose,
    )


def closed(mesh: TriangleMesh) -> bool:
    """Whether each edge of the mesh is run through as often in one direction as in the other."""
    if not len(mesh.faces):
        return False
    edges = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    forward = edges[:, 0] < edges[:, 1]
    _, edge_indices = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    return not np.bincount(edge_indices.ravel(), weights=np.where(forward, 1.0, -1.0)).any()
