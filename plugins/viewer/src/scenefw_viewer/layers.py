"""What a viewer shows of a prediction, as arrays: points, slices, captions, where to stand."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import quaternion_from_rotation
from scenefw.perception.observation.points import world_points
from scenefw.report.palette import instance_colours
from scenefw.report.window import vertices
from scenefw_editing.sizes import volume

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import (
        Float32,
        Float64,
        Frame,
        GridSpec,
        ObjectEstimate,
        SceneEstimate,
    )

    Bytes = NDArray[np.uint8]
    Cloud = tuple[Float32, Bytes]

_COLUMNS = 400  # of the image, at least so many are shown as points
_REACH = 0.85  # m from the z axis
_LOWEST, _HIGHEST = -0.15, 1.0  # m
_NEAR, _FAR = np.array([235.0, 238.0, 242.0]), np.array([95.0, 110.0, 130.0])
_FREE, _BEHIND = np.array([0.79, 0.30, 0.13]), np.array([0.10, 0.38, 0.66])
_AXES = ([1, 2], [0, 2], [0, 1])  # right and up of a slice across x, y, z
_LEAST_RADIUS = 0.12  # m
_AWAY = 3.3  # radii between the eye and the middle of the objects
_UPRIGHT = 0.45  # least sine of the angle under which one looks down


@dataclass(frozen=True)
class Prediction:
    """What is known of an image.

    Args:
        scenes: hypotheses, the most typical one first; an object has the same id in all.
        frame: the image as it was read.
        partial: (X, Y, Z) partial TSDF (m) on the grid of the scenes.
    """

    scenes: tuple[SceneEstimate, ...]
    frame: Frame
    partial: Float32


@dataclass(frozen=True)
class Slice:
    """A picture (H, W, 3) and the pose of its plane: x right, y down, side lengths in metres."""

    picture: Bytes
    position: Float64
    quaternion: Float64
    size: float


def cloud(prediction: Prediction) -> Cloud:
    """Points (N, 3) of the depth image around the scene (m), and their colours (N, 3).

    Without a colour image they are the paler, the nearer they are.
    """
    frame, points, mask = _around(prediction)
    if frame.colour is not None:
        step = _stride(frame)
        return points[mask].astype(np.float32), frame.colour[::step, ::step][mask]
    depth = frame.depth[:: _stride(frame), :: _stride(frame)][mask]
    low, high = (np.percentile(depth, (1, 99))) if depth.size else (0.0, 1.0)
    share = np.clip((depth - low) / max(high - low, 1e-6), 0, 1)[:, None]
    return points[mask].astype(np.float32), np.rint(_NEAR + share * (_FAR - _NEAR)).astype("u1")


def truth(prediction: Prediction) -> Cloud | None:
    """Points of true objects in a colour each; None if the image has no labels."""
    if prediction.frame.labels is None or prediction.frame.labels.max() < 1:
        return None
    frame, points, mask = _around(prediction)
    step = _stride(frame)
    labels = prediction.frame.labels[::step, ::step]
    mask = mask & (labels > 0)
    palette = np.array(instance_colours(int(labels.max())))
    return points[mask].astype(np.float32), _bytes(palette[labels[mask] - 1])


def _around(prediction: Prediction) -> tuple[Frame, NDArray[np.float64], NDArray[np.bool_]]:
    """The whole image with the estimated camera, its points, and which are near the scene."""
    frame = replace(prediction.frame, camera=prediction.scenes[0].frame.camera)
    points = world_points(frame, _stride(frame))
    x, y, z = np.moveaxis(np.nan_to_num(points, nan=np.inf), -1, 0)
    return frame, points, (np.hypot(x, y) < _REACH) & (z > _LOWEST) & (z < _HIGHEST)


def _stride(frame: Frame) -> int:
    return max(1, frame.camera.width // _COLUMNS)


def slice_volume(distance: Float32, grid: GridSpec, axis: int, place: float) -> Slice:
    """A slice of signed distances: free space reddish, behind surfaces blue, surfaces white.

    Args:
        distance: (X, Y, Z) metres.
        grid: its voxel grid.
        axis: 0, 1 or 2: the slice is across x, y or z.
        place: where, in world coordinates (m).
    """
    index = int(np.clip(np.rint(grid.to_voxels(np.full(3, place))[axis]), 0, grid.resolution - 1))
    plane = np.take(distance, index, axis=axis).T[::-1]  # rows from the top
    share = np.clip(plane / grid.truncation, -1, 1)[..., None]
    colour = np.where(share > 0, _FREE, _BEHIND)
    right, up = np.eye(3)[_AXES[axis]]
    middle = np.asarray(grid.lower) + grid.extent / 2
    middle[axis] = grid.lower[axis] + (index + 0.5) * grid.voxel_size
    turn = np.stack([right, -up, np.cross(right, -up)], axis=1)
    picture = _bytes(1 + np.abs(share) * (colour - 1))
    return Slice(picture, middle, quaternion_from_rotation(turn), grid.extent)


def caption(item: ObjectEstimate) -> str:
    """Number and volume of an object."""
    return f"{item.id}: {1000 * volume(item.mesh):.2f} l"


def start(scene: SceneEstimate) -> tuple[Float64, Float64]:
    """Eye and the point it looks at (m): on the camera's side, near enough that objects are large.

    Args:
        scene: its objects, or the middle of its grid if it has none.
    """
    points = vertices(scene)
    if len(points) == 0:
        points = np.asarray(scene.grid.lower) + np.array([[0.3], [0.7]]) * scene.grid.extent
    low, high = points.min(axis=0), points.max(axis=0)
    middle, radius = (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, _LEAST_RADIUS)
    offset = scene.frame.camera.T_world_camera[:3, 3] - middle
    flat = offset[:2] / max(float(np.linalg.norm(offset[:2])), 1e-9)
    sine = float(np.clip(offset[2] / max(float(np.linalg.norm(offset)), 1e-9), _UPRIGHT, 0.8))
    direction = np.append(flat * np.sqrt(1 - sine**2), sine)
    return middle + _AWAY * radius * direction, middle


def _bytes(colour: NDArray[np.float64]) -> Bytes:
    return np.rint(np.clip(colour, 0, 1) * 255).astype(np.uint8)
