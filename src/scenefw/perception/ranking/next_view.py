"""Where to look next: the view that would tell the hypotheses of a scene apart best."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse, look_at, transform_points
from scenefw.core.types import Float64
from scenefw.perception.estimate.base_frame import floor_pose, in_base
from scenefw.perception.observation.points import MIN_PARALLEL_COSINE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, GridSpec, SceneEstimate


@dataclass(frozen=True, eq=False)
class ViewScore:
    """How much a view would tell.

    Args:
        T_world_camera: (4, 4) pose of the camera.
        score: share of the spread of the hypotheses that the view is expected to remove, 0 to 1.
        volume: the same in cubic metres, of the variance of occupancy summed over space.
    """

    T_world_camera: Float64
    score: float
    volume: float


def next_views(scenes: Sequence[SceneEstimate], poses: Sequence[Float64]) -> list[ViewScore]:
    """Views in the order of how much they are expected to tell, the best one first.

    The spread is the variance p (1 - p) of a voxel's occupancy over the hypotheses. If one of them
    is true, a view removes the spread of those voxels that it reaches: free ones up to the surface,
    and that. The score is the mean over the hypotheses, each as likely as the others.

    Args:
        scenes: hypotheses of one image on one grid; with fewer than two, no view tells anything.
        poses: (4, 4) camera (OpenCV) to world, of cameras like that of the image.

    Raises:
        InputError: no pose, or one that isn't 4 x 4.
    """
    poses = [np.asarray(pose, dtype=np.float64) for pose in poses]
    if not poses or any(pose.shape != (4, 4) for pose in poses):
        raise InputError("next views need poses, 4 x 4 matrices from camera to world; give some")
    grid, camera = scenes[0].grid, scenes[0].frame.camera
    solids = np.stack([scene.tsdf < 0 for scene in scenes])
    probability = solids.mean(axis=0)
    spread = probability * (1 - probability)
    uncertain = np.argwhere(spread > 0)
    weights = spread[tuple(uncertain.T)]
    places = grid.to_world(uncertain.astype(np.float64))
    scores = []
    for pose in poses:
        viewed = camera.moved(pose)
        inside = _in_image(places, viewed)
        removed = [weights[_reached(places, inside, solid, grid, pose)].sum() for solid in solids]
        total = float(np.mean(removed))
        share = total / float(weights.sum()) if len(weights) else 0.0
        scores.append(ViewScore(pose, share, total * grid.voxel_size**3))
    return sorted(scores, key=lambda view: -view.score)


def next_views_in_base(
    scenes: Sequence[SceneEstimate], poses: Sequence[Float64] | None = None, count: int = 48
) -> list[ViewScore]:
    """As `next_views`, of given or sampled poses, in the frame in which a scene is written.

    Args:
        scenes: hypotheses of one image in the frame of the floor.
        poses: (4, 4) camera to a robot's base where the camera's pose in it is known, else to the
            floor's frame; None: `views_around` the objects.
        count: of sampled poses.

    Raises:
        InputError: as `next_views`.
    """
    motion = floor_pose(in_base(scenes[0]).details)
    if poses is None:
        floor_poses = views_around(scenes[0], count)
    else:
        matrices = [np.asarray(pose, dtype=np.float64) for pose in poses]
        floor_poses = [
            inverse(motion) @ pose if pose.shape == (4, 4) else pose for pose in matrices
        ]
    views = next_views(scenes, floor_poses)
    return [replace(view, T_world_camera=motion @ view.T_world_camera) for view in views]


def views_around(scene: SceneEstimate, count: int = 48) -> list[Float64]:
    """Poses (4, 4) all around the objects, as far away as the image's camera, spread evenly.

    Args:
        scene: with an object or more; else the middle of the grid's floor is looked at.
        count: of the poses.
    """
    vertices = [item.mesh.vertices for item in scene.objects]
    middle = np.array(scene.grid.lower) + scene.grid.extent / 2
    middle[2] = 0.0
    if vertices:
        points = np.concatenate(vertices)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = float(np.linalg.norm(scene.frame.camera.T_world_camera[:3, 3] - middle))
    high = MIN_PARALLEL_COSINE  # neither along the floor nor straight down
    low = np.sqrt(1 - high**2)
    heights = low + (np.arange(count) + 0.5) / count * (high - low)
    angles = np.arange(count) * np.pi * (3 - np.sqrt(5))  # the golden angle: a Fibonacci lattice
    radii = np.sqrt(1 - heights**2)
    directions = np.column_stack([radii * np.cos(angles), radii * np.sin(angles), heights])
    return [look_at(middle + distance * direction, middle) for direction in directions]


def _in_image(places: Float64, camera: Camera) -> NDArray[np.bool_]:
    x, y, z = transform_points(inverse(camera.T_world_camera), places).T
    depth = np.where(z > 0, z, np.inf)
    u, v = camera.fx * x / depth + camera.cx, camera.fy * y / depth + camera.cy
    return (z > 0) & (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)


def _reached(
    places: Float64,
    inside: NDArray[np.bool_],
    solid: NDArray[np.bool_],
    grid: GridSpec,
    pose: Float64,
) -> NDArray[np.bool_]:
    """Which places (N, 3) a camera sees if a scene is solid there: nothing is in between."""
    reached = np.zeros(len(places), dtype=bool)
    eye, targets = pose[:3, 3], places[inside]
    if not len(targets):
        return reached
    ways = eye - targets
    lengths = np.linalg.norm(ways, axis=1, keepdims=True)
    diagonal = grid.extent * np.sqrt(3)
    # a voxel at a time, from beyond the place's own and its neighbours, which may be solid
    offsets = np.arange(2, diagonal / grid.voxel_size) * grid.voxel_size
    free = np.ones(len(targets), dtype=bool)
    for offset in offsets:  # outwards; those that left the grid meet nothing any more
        rows = np.flatnonzero(free & (lengths[:, 0] > offset))
        points = targets[rows] + ways[rows] / lengths[rows] * offset
        voxels, is_in_grid = grid.nearest_voxels(points)
        if not is_in_grid.any():
            break
        hit = solid[tuple(voxels[is_in_grid].T)]
        free[rows[is_in_grid][hit]] = False
    reached[inside] = free
    return reached
