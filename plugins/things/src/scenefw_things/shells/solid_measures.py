"""How well the solid of one object is told: Chamfer distance, and overlap of voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError, cKDTree
from skimage.measure import marching_cubes

from scenefw_things.shapes.part_unions import inside, planes_of, points_on
from scenefw_things.shells.batches import ENTRY, EXIT, GAP_END, GAP_START

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Float64

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


class ObjectShell(NamedTuple):
    """The shell of one object.

    Args:
        camera: of R x R pixels.
        amodal: (R, R) rays that meet it.
        hollow: (R, R) rays that leave it and enter it again.
        depths: (4, R, R) as of `core.object_shells.Shells` (m).
    """

    camera: Camera
    amodal: NDArray[np.bool_]
    hollow: NDArray[np.bool_]
    depths: Float32

    def depths_inside(self, places: Float64) -> Float64:
        """How deep inside (P,) places (P, 3) are along their rays (m), negative outside."""
        camera = self.camera
        local = (places - camera.T_world_camera[:3, 3]) @ camera.T_world_camera[:3, :3]
        z = local[:, 2]
        size = np.array(self.amodal.shape)[::-1]
        pixels = local[:, :2] / np.maximum(z, 1e-6)[:, None] * (camera.fx, camera.fy)
        pixels = np.rint(pixels + (camera.cx, camera.cy))
        shown = (z > 0) & (pixels >= 0).all(axis=1) & (pixels < size).all(axis=1)
        u, v = np.where(shown[:, None], pixels, 0).astype(int).T
        depths = self.depths[:, v, u]
        depth = np.minimum(z - depths[ENTRY], depths[EXIT] - z)
        outside_gap = np.maximum(depths[GAP_START] - z, z - depths[GAP_END])
        depth = np.where(self.hollow[v, u], np.minimum(depth, outside_gap), depth)
        return np.where(shown & self.amodal[v, u], depth, -np.inf)

    def places(self) -> Float64:
        """Entry and exit points (P, 3) of all rays that meet it, in the world."""
        camera, (v, u) = self.camera, np.nonzero(self.amodal)
        rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy,
                         np.ones(len(u))], axis=1)  # fmt: skip
        depths = self.depths[[ENTRY, EXIT]][:, v, u].ravel()[:, None]
        local = np.tile(rays, (2, 1)) * depths
        return local @ camera.T_world_camera[:3, :3].T + camera.T_world_camera[:3, 3]


def shell_solid(shell: ObjectShell, rng: np.random.Generator) -> Solid | None:
    """A shell as a solid; None if it is thinner than its grid everywhere."""
    places = shell.places()
    low, high = places.min(axis=0), places.max(axis=0)
    step = max(_STEP, float((high - low).max()) / _MAX_STEPS)
    shape = np.ceil((high - low) / step).astype(int) + 3
    grid = np.indices(shape).reshape(3, -1).T * step + (low - step)
    values = np.clip(shell.depths_inside(grid), -step, step).reshape(shape)
    if not (values > 0).any():
        return None
    corners, faces, _, _ = marching_cubes(values, 0.0, spacing=(step,) * 3)
    triangles = corners.astype(np.float64)[faces] + (low - step)
    points, _ = points_on(triangles, _POINTS, rng)
    return Solid(lambda x: shell.depths_inside(x) > 0, points)


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
