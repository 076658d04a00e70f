"""Convex shapes that simulators take for objects."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from scipy import spatial

from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.types import TriangleMesh
from scenefw.shapes import convex_parts
from scenefw.shapes.hulls import Array, covering, hull_mesh, sphere_points

_SIDE = 0.005  # of a hull's surface: flat parts from here on are kept flat


class ConvexHull:
    """One convex hull per object.

    Args:
        tolerance: of how much it may be inside the exact hull, for fewer corners (m).

    Raises:
        ConfigError: a tolerance that isn't positive.
    """

    def __init__(self, tolerance: float = 0.001) -> None:
        if not tolerance > 0:
            raise ConfigError(f"the hulls' tolerance is {tolerance}; expected metres above 0")
        self.tolerance = tolerance

    def parts(self, mesh: TriangleMesh) -> list[TriangleMesh]:
        """The hull alone."""
        return [_thinned_hull(mesh.vertices, self.tolerance)]


class ConvexParts:
    """Convex parts by CoACD (Wei et al. 2022): bowls and cups stay hollow.

    Args:
        convex: an object that fills this share of its convex hull is that hull.
        concavity: of a part at most, as a share of the object's size.
        most: parts of an object at most.
        seed: of the search.

    Raises:
        ConfigError: a number out of range.
        MissingDependencyError: coacd is not installed.
    """

    def __init__(
        self, convex: float = 0.95, concavity: float = 0.05, most: int = 16, seed: int = 0
    ) -> None:
        convex_parts.CONCAVITY.require(concavity=concavity)
        self.division = convex_parts.ConvexParts(convex, concavity, most, seed)
        if find_spec("coacd") is None:
            raise MissingDependencyError(
                "convex parts need coacd: pip install 'scenefw[parts]', or choose "
                "collision=convex_hull"
            )

    def parts(self, mesh: TriangleMesh) -> list[TriangleMesh]:
        """As many as the object needs."""
        return [hull_mesh(part) for part in self.division.of(mesh) or (mesh.vertices,)]


def _thinned_hull(points: Array, tolerance: float) -> TriangleMesh:
    """The convex hull of few of the points, nowhere more than `tolerance` inside that of all.

    Args:
        points: (N, 3) metres, not all in a plane.
        tolerance: metres, held in 1500 directions and along flat sides.
    """
    hull = spatial.ConvexHull(points)
    corners = points[hull.vertices]
    directions = np.concatenate([np.eye(3), -np.eye(3), _sides(hull), sphere_points(1500)])
    support = corners[(corners @ directions.T).argmax(axis=0)]
    return hull_mesh(support[covering(directions, support, tolerance)])


def _sides(hull: spatial.ConvexHull) -> Array:
    """Normals (K, 3) of its large flat sides."""
    a, b, c = (hull.points[hull.simplices[:, i]] for i in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    normals, side_indices = np.unique(hull.equations[:, :3].round(6), axis=0, return_inverse=True)
    return normals[np.bincount(side_indices.ravel(), areas) > _SIDE * hull.area]
