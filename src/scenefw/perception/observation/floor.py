"""The plane that the objects stand on, by RANSAC."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core import rng
from scenefw.core.errors import InputError
from scenefw.core.floors import Floor
from scenefw.core.settings import COUNT, POSITIVE, SHARE
from scenefw.core.types import Frame
from scenefw.perception.observation.points import camera_points

Array = NDArray[np.float64]

_MIN_UPRIGHT = -0.2  # of the normal along the image's up: walls before a camera are below
_MAX_SIDEWAYS = 0.7  # of the normal along the image's right: a roll of 45 degrees
_SCORED_POINTS = 4096
_TABLE_HEIGHT = 0.3  # a plane this far above another (m) is a table on a room's floor, ...
_TABLE_SHARE = 0.4  # ... not the top of an object, if it has this share of the other's points
_MIN_PARALLEL_COSINE = np.cos(np.radians(8))  # of the angle between two planes
_REFINEMENTS = 5
_MIN_POINTS = 100  # points that may tell where a floor is


class FloorFinder:
    """Finds the table or floor under the objects of a depth image (RANSAC, Fischler & Bolles 1981).

    Of planes through three random points the one with most points wins, among those that face up
    in the image and have the camera above them; a table wins over the room's floor below it. A
    least-squares fit to its points follows. The same image gives the same floor.

    Args:
        inlier_distance: points this close to a plane lie on it at 1 m; grows with depth squared
            (m).
        iterations: random planes tried.
        max_depth: points farther away don't count (m); keeps a room's floor and walls out.
        min_inlier_ratio: of the points within reach that must lie on the plane.

    Raises:
        ConfigError: a share outside 0..1, no iteration, or a length that isn't positive.
    """

    def __init__(
        self,
        inlier_distance: float = 0.008,
        iterations: int = 1000,
        max_depth: float = 2.0,
        min_inlier_ratio: float = 0.15,
    ) -> None:
        POSITIVE.require(inlier_distance=inlier_distance, max_depth=max_depth)
        COUNT.require(iterations=iterations)
        SHARE.require(min_inlier_ratio=min_inlier_ratio)
        self.inlier_distance = inlier_distance
        self.iterations = iterations
        self.max_depth = max_depth
        self.min_inlier_ratio = min_inlier_ratio

    def find(self, frame: Frame) -> Floor:
        """The floor of a frame.

        Raises:
            InputError: too few points within reach, or no plane among them.
        """
        points = points_within(frame, self.max_depth)
        normal, height = self._best_plane(points, frame.name)
        for _ in range(_REFINEMENTS):
            inliers = self._inliers(points, points @ normal + height)
            normal, height = _fit_plane(points[inliers])
        distance = points @ normal + height
        inliers = self._inliers(points, distance)
        share = float(inliers.mean())
        if share < self.min_inlier_ratio:
            raise _no_floor(frame.name, share, self.min_inlier_ratio)
        deviation = float(np.sqrt(np.mean(distance[inliers] ** 2)))
        return Floor(normal, float(height), share, deviation)

    def _best_plane(self, points: Array, name: str) -> tuple[Array, float]:
        """Normal and height of the random plane with the highest score, on a subset of points."""
        random = rng.generator(0)  # the same planes for all images
        sample = points[random.choice(len(points), min(_SCORED_POINTS, len(points)), replace=False)]
        corners = sample[random.integers(len(sample), size=(self.iterations, 3))]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        normals, corners = normals[length > 1e-6], corners[length > 1e-6]
        normals /= length[length > 1e-6, None]
        heights = -np.einsum("ij,ij->i", normals, corners[:, 0])
        signs = np.where(heights < 0, -1.0, 1.0)  # the camera is above its floor
        normals, heights = normals * signs[:, None], heights * signs
        upright = -normals[:, 1]
        is_allowed = (upright > _MIN_UPRIGHT) & (np.abs(normals[:, 0]) < _MAX_SIDEWAYS)
        if not is_allowed.any():
            raise _no_floor(name, 0.0, self.min_inlier_ratio)
        inliers = self._inliers(sample, normals @ sample.T + heights[:, None])
        score = inliers.mean(axis=1) * (1 + upright) * is_allowed  # a table rather than a wall
        best = int(np.argmax(score))
        is_raised = (heights < heights[best] - _TABLE_HEIGHT) & (
            normals @ normals[best] > _MIN_PARALLEL_COSINE
        )
        tables = np.where(is_raised & (score > _TABLE_SHARE * score[best]), score, 0.0)
        best = int(np.argmax(tables)) if tables.any() else best
        return normals[best], float(heights[best])

    def _inliers(self, points: Array, distance: Array) -> NDArray[np.bool_]:
        return near_plane(points, distance, self.inlier_distance)


def points_within(frame: Frame, farthest: float) -> Array:
    """Every few of a frame's points (N, 3) in camera coordinates, up to a depth (m).

    Raises:
        InputError: there are hardly any.
    """
    stride = max(1, min(frame.depth.shape) // 160)
    points = camera_points(frame, stride).reshape(-1, 3)
    points = points[points[:, 2] < farthest]
    if len(points) < _MIN_POINTS:
        raise InputError(
            f"no floor in {frame.name}: only {len(points)} points are nearer than "
            f"{farthest:g} m; the camera must see the table; or check the unit of depth"
        )
    return points


def near_plane(points: Array, distance: Array, threshold: float) -> NDArray[np.bool_]:
    """Which points (N, 3) lie on a plane, by their distances (..., N) from it (m).

    `threshold` (m) holds up to a depth of 1 m, and grows with its square beyond.
    """
    return np.abs(distance) < threshold * np.maximum(1.0, points[:, 2]) ** 2


def _fit_plane(points: Array) -> tuple[Array, float]:
    """Least-squares plane of points (N, 3), its normal on the side of the origin."""
    centre = points.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((points - centre).T))
    normal = vectors[:, 0]
    height = -float(normal @ centre)
    return (normal, height) if height > 0 else (-normal, -height)


def _no_floor(name: str, share: float, min_share: float) -> InputError:
    return InputError(
        f"no floor in {name}: the best plane that faces up holds {share:.0%} of the points, "
        f"{min_share:.0%} are needed; the camera must look at a table or floor, image upright"
    )
