"""The plane that the objects stand on, by RANSAC."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from scenefw.core import rng
from scenefw.core.errors import InputError
from scenefw.core.floors import Floor
from scenefw.core.settings import COUNT, POSITIVE, SHARE
from scenefw.core.types import Frame
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.observation.floor_noise import robust_sigma
from scenefw.perception.observation.points import (
    MIN_PARALLEL_COSINE,
    MIN_POINTS,
    REFINEMENTS,
    SAMPLE,
    camera_points,
)

Array = NDArray[np.float64]

_UPRIGHT_WEIGHT = 1.5  # images are mostly upright: planes that aren't floors then need more points
TABLE_HEIGHT = 0.3
"""A plane this far above another (m) is a table on a room's floor; so high is what lies on one."""


@dataclass(frozen=True, eq=False)
class FloorFinder:
    """Finds the table or floor under the objects of a depth image (RANSAC, Fischler & Bolles 1981).

    Of planes through three random points the one with most points wins that has the camera above
    it. Points that are seen through a plane, within the hull of its own, count against it: no floor
    is transparent. A table wins over the room's floor below it, and a higher one over a lower. A
    least-squares fit follows. The camera may be rolled. The same image gives the same floor.

    Args:
        inlier_distance: points this close to a plane lie on it at 1 m; grows with depth squared
            (m).
        iterations: random planes tried.
        max_depth: points farther away don't count (m); keeps a room's floor and walls out.
        min_inlier_ratio: of the points within reach that must lie on the plane.

    Raises:
        ConfigError: a share outside 0..1, no iteration, or a length that isn't positive.
    """

    inlier_distance: float = 0.008
    iterations: int = 1000
    max_depth: float = 2.0
    min_inlier_ratio: float = 0.15

    def __post_init__(self) -> None:
        POSITIVE.require(inlier_distance=self.inlier_distance, max_depth=self.max_depth)
        COUNT.require(iterations=self.iterations)
        SHARE.require(min_inlier_ratio=self.min_inlier_ratio)

    def find(self, frame: Frame) -> Floor:
        """The floor of a frame.

        Raises:
            InputError: too few points within reach, or no plane among them.
        """
        points = points_within(frame, self.max_depth)
        largest, *further_planes = self._planes(points)
        tables = [plane for plane in further_planes if self._is_table(plane, largest)]
        floor = min(tables, key=lambda plane: plane.height, default=largest)
        if floor.share < self.min_inlier_ratio:
            raise InputError(
                f"no floor in {frame.name}: the best plane below the camera holds "
                f"{floor.share:.0%} of the points, {self.min_inlier_ratio:.0%} are needed; the "
                "camera must look at a table or floor"
            )
        return floor

    def _planes(self, points: Array) -> list[Floor]:
        """Planes, each without the points of those before, as long as one might be a table."""
        random = rng.generator(0)  # the same planes for all images
        planes: list[Floor] = []
        remaining = points
        while len(remaining) >= MIN_POINTS:
            normal, height = self._best_plane(remaining, points, random)
            plane = self._fit(points, normal, height)
            planes.append(plane)
            is_on_plane = self._inliers(remaining, remaining @ plane.normal + plane.height)
            if is_on_plane.sum() <= self.min_inlier_ratio * len(points):
                break
            remaining = remaining[~is_on_plane]
        return planes

    def _best_plane(
        self, points: Array, all_points: Array, random: np.random.Generator
    ) -> tuple[Array, float]:
        """Normal and height of the random plane with the highest score, on a subset of points."""
        sample = points[random.choice(len(points), min(SAMPLE, len(points)), replace=False)]
        corners = sample[random.integers(len(sample), size=(self.iterations, 3))]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normals, axis=1)
        normals, corners = normals[length > 1e-6], corners[length > 1e-6]
        normals /= length[length > 1e-6, None]
        heights = -np.einsum("ij,ij->i", normals, corners[:, 0])
        signs = np.where(heights < 0, -1.0, 1.0)  # the camera is above its floor
        normals, heights = normals * signs[:, None], heights * signs
        upright = _UPRIGHT_WEIGHT + np.maximum(-normals[:, 1], 0.0)
        most = upright * self._inlier_ratios(sample, normals, heights)
        subset = all_points[:: max(1, len(all_points) // len(sample))]
        margins = _margins(subset, 2 * self.inlier_distance)
        image, sample_image = (rows[:, :2] / rows[:, 2:] for rows in (subset, sample))
        best, best_score = -1, -np.inf
        for i in np.argsort(-most):
            if most[i] <= best_score:  # nor has any plane after it a higher score
                break
            is_on_plane = self._inliers(sample, sample @ normals[i] + heights[i])
            is_hidden = subset @ normals[i] + heights[i] <= -margins
            seen_through = _count_inside(image[is_hidden], sample_image[is_on_plane]) / len(subset)
            score = most[i] - upright[i] * seen_through
            if score > best_score:
                best, best_score = i, score
        return normals[best], float(heights[best])

    def _inlier_ratios(self, points: Array, normals: Array, heights: Array) -> Array:
        """Ratio (P,) of points (N, 3) that lie on each of P planes."""
        parts = [  # so small that a core's cache holds the distances of all points
            np.array_split(rows, math.isqrt(len(normals))) for rows in (normals, heights[:, None])
        ]
        distances = (part @ points.T + height for part, height in zip(*parts, strict=True))
        return np.concatenate([self._inliers(points, d).mean(axis=1) for d in distances])

    def _fit(self, points: Array, normal: Array, height: float) -> Floor:
        """Least-squares plane of the points that are near one, as near as their noise allows."""
        threshold = self.inlier_distance
        for _ in range(REFINEMENTS):
            inliers = near_plane(points, points @ normal + height, threshold)
            normal, height = _fit_plane(points[inliers])
            distance = points @ normal + height
            inliers = near_plane(points, distance, threshold)
            noise = OUTLIERS * robust_sigma(distance[inliers])
            threshold = np.clip(noise, self.inlier_distance / 4, self.inlier_distance)
        inliers = self._inliers(points, distance)
        mean_square = float(np.mean(distance[inliers] ** 2))
        return Floor(normal, float(height), float(inliers.mean()), float(np.sqrt(mean_square)))

    def _is_table(self, plane: Floor, floor: Floor) -> bool:
        """Whether a plane is a table on a room's floor."""
        return bool(
            plane.height < floor.height - TABLE_HEIGHT
            and plane.normal @ floor.normal > MIN_PARALLEL_COSINE
            and plane.share > self.min_inlier_ratio  # it isn't the top of an object
        )

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
    if len(points) < MIN_POINTS:
        raise InputError(
            f"no floor in {frame.name}: only {len(points)} points are nearer than "
            f"{farthest:g} m; the camera must see the table; or check the unit of depth"
        )
    return points


def _count_inside(places: Array, outline: Array) -> int:
    """How many places (N, 2) are within the convex hull of others (M, 2)."""
    try:
        sides = ConvexHull(outline).equations
    except (QhullError, ValueError):  # all on one line
        return 0
    return int(((sides[:, :2] @ places.T + sides[:, 2:]).max(axis=0) < 0).sum())


def near_plane(points: Array, distance: Array, threshold: float) -> NDArray[np.bool_]:
    """Which points (N, 3) lie on a plane, by their distances (..., N) from it (m).

    `threshold` (m) holds up to a depth of 1 m, and grows with its square beyond.
    """
    return np.abs(distance) < _margins(points, threshold)


def _margins(points: Array, threshold: float) -> Array:
    """Threshold (N,) of each point (N, 3), as of `near_plane`."""
    return threshold * np.maximum(1.0, points[:, 2]) ** 2


def _fit_plane(points: Array) -> tuple[Array, float]:
    """Least-squares plane of points (N, 3), its normal on the side of the origin."""
    centre = points.mean(axis=0)
    _, vectors = np.linalg.eigh(np.cov((points - centre).T))
    normal = vectors[:, 0]
    height = -float(normal @ centre)
    return (normal, height) if height > 0 else (-normal, -height)
