"""How well the solid of one object is told: Chamfer distance, and overlap of voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree

from scenefw_things.shapes.part_unions import inside, planes_of, points_on

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from scenefw.core.types import Float64
    from scenefw.shapes.object_shell import ObjectShell

    Inside = Callable[[Float64], NDArray[np.bool_]]

VOXEL = 0.006
"""m: side of the voxels whose overlap counts."""
_STEP = 0.003  # m: of the grid on which the surface of a shell is found
_MAX_STEPS = 64  # of this grid along an axis; larger objects have a wider one
_POINTS = 4000  # on a surface


class Solid(NamedTuple):
    """A solid as it is scored.

    Args:
        inside: which of some places (P, 3) lie inside.
        points: (N, 3) on its surface, uniform by area (m).
    """

    inside: Inside
    points: Float64


def shell_solid(shell: ObjectShell, rng: np.random.Generator) -> Solid | None:
    """A shell as a solid; None if it is thinner than its grid everywhere."""
    mesh = shell.mesh(max(_STEP, float(np.ptp(shell.places(), axis=0).max()) / _MAX_STEPS))
    if mesh is None:
        return None
    points, _ = points_on(mesh.vertices[mesh.faces], _POINTS, rng)
    return Solid(lambda x: shell.signed_distance(x) < 0, points)


def hull_solid(points: Float64, rng: np.random.Generator, *, footprint: bool) -> Solid | None:
    """The convex hull of visible points; None if they lie in a plane.

    Args:
        points: (N, 3) m, the floor at z = 0.
        rng: of points on it.
        footprint: with the points' footprints on the floor.
    """
    if footprint:
        points = np.concatenate([points, points * (1, 1, 0)])
    try:
        hull = ConvexHull(points)
        planes = planes_of(points[hull.vertices])
    except (QhullError, ValueError):
        return None
    surface, _ = points_on(points[hull.simplices], _POINTS, rng)
    return Solid(lambda x: inside(x, [planes]), surface)


def chamfer(first: Float64, second: Float64) -> float:
    """Mean distance (m) from points to the nearest of the others, the mean of both directions."""
    forward, _ = cKDTree(second).query(first)
    backward, _ = cKDTree(first).query(second)
    return float(forward.mean() + backward.mean()) / 2


def overlap(first: Solid, second: Solid) -> float:
    """Intersection over union of voxels whose middle lies inside; 0 if no middle does."""
    points = np.concatenate([first.points, second.points])
    low, high = np.floor(points.min(axis=0) / VOXEL), np.ceil(points.max(axis=0) / VOXEL)
    shape = np.maximum(high - low, 1).astype(int)
    middles = (np.indices(shape).reshape(3, -1).T + low + 0.5) * VOXEL
    a, b = first.inside(middles), second.inside(middles)
    return float((a & b).sum() / max((a | b).sum(), 1))
