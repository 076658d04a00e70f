"""Scenes in the coordinates of a robot's base, where the pose of the camera in it is known.

Within scenefw a scene stands on the floor z = 0. What is written or sent goes through `in_base`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.geometry import inverse
from scenefw.core.types import Float64
from scenefw.data.files.pose_conventions import CONVENTIONS, converted
from scenefw.data.files.poses import MAX_CAMERA_DISTANCE
from scenefw.perception.estimate.transforms import moved_object, moved_obstacle
from scenefw.perception.observation.points import MIN_PARALLEL_COSINE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from scenefw.core.types import ObjectEstimate, SceneEstimate

CAMERA_IN_BASE = "T_base_camera"
"""Detail of a scene in the floor's frame whose camera's pose in a robot's base is known."""

FLOOR_IN_BASE = "T_base_floor"
"""Detail of a scene in a robot's base: where the frame of its floor lies in it."""

TRACKS = "tracks"
"""Detail of a scene of several images: what each object did (plugin `tracking`)."""


def with_camera_in_base(estimate: SceneEstimate, T_base_camera: Float64 | None) -> SceneEstimate:  # noqa: N803
    """The same scene, which `in_base` will bring into a robot's base.

    Args:
        estimate: in the frame of its floor.
        T_base_camera: 4x4, camera (OpenCV) to the base; None leaves the scene as it is.
    """
    if T_base_camera is None:
        return estimate
    pose = np.asarray(T_base_camera, dtype=np.float64)
    warnings = [*estimate.details.get("warnings", ()), *_doubts(estimate, pose)]
    details = {**estimate.details, CAMERA_IN_BASE: pose.tolist(), "warnings": warnings}
    return replace(estimate, details=details)


def _doubts(estimate: SceneEstimate, pose: Float64) -> list[str]:
    """What is odd about the pose of a camera in a robot's base, a line each."""
    lines = []
    distance = float(np.linalg.norm(pose[:3, 3]))
    if distance > MAX_CAMERA_DISTANCE:
        lines.append(
            f"camera_pose puts the camera {distance:.3g} m from the base; give metres, not "
            "millimetres"
        )
    floor_camera = estimate.frame.camera.T_world_camera
    up = _up_in_base(pose, floor_camera)
    if up < MIN_PARALLEL_COSINE:
        cosines = {n: _up_in_base(converted(pose, n), floor_camera) for n in CONVENTIONS}
        names = [name for name, cosine in cosines.items() if cosine > MIN_PARALLEL_COSINE]
        advice = f"with {CONVENTIONS[names[0]]} it would be level" if names else "is it up to date?"
        lines.append(
            f"by camera_pose the table is tilted by {np.degrees(np.arccos(up)):.0f} degrees in the "
            f"base ({advice}); all is right if the base itself is tilted"
        )
    return lines


def _up_in_base(T_base_camera: Float64, T_floor_camera: Float64) -> float:  # noqa: N803
    """Cosine between the floor's normal and the base's z axis."""
    motion = T_base_camera @ inverse(T_floor_camera)
    return float(np.clip(motion[2, 2], -1, 1))


def in_base(estimate: SceneEstimate) -> SceneEstimate:
    """Objects, obstacles and camera in a robot's base, if the camera's pose in it is known.

    Grid and volumes stay in the frame of the floor.
    """
    if CAMERA_IN_BASE not in estimate.details:
        return estimate
    camera = estimate.frame.camera
    T_base_camera = np.array(estimate.details[CAMERA_IN_BASE])  # noqa: N806
    motion = T_base_camera @ inverse(camera.T_world_camera)
    details = {k: v for k, v in estimate.details.items() if k != CAMERA_IN_BASE}
    return replace(
        estimate,
        objects=tuple(moved_object(item, motion) for item in estimate.objects),
        obstacles=tuple(moved_obstacle(item, motion) for item in estimate.obstacles),
        frame=replace(estimate.frame, camera=camera.moved(T_base_camera)),
        details={**moved_details(details, motion), FLOOR_IN_BASE: motion.tolist()},
    )


def floor_pose(details: Mapping[str, Any]) -> Float64:
    """4x4, frame of the floor to the frame in which the objects of an estimate are."""
    return np.array(details.get(FLOOR_IN_BASE, np.eye(4)), dtype=np.float64)


def on_floor(estimate: SceneEstimate) -> Sequence[ObjectEstimate]:
    """The objects of an estimate in the frame of the floor, wherever they are."""
    if FLOOR_IN_BASE not in estimate.details:
        return estimate.objects
    motion = inverse(floor_pose(estimate.details))
    return [moved_object(item, motion) for item in estimate.objects]


def moved_details(details: Mapping[str, Any], motion: Float64) -> dict[str, Any]:
    """Details in other coordinates: the motions of tracked objects are."""
    if TRACKS not in details:
        return dict(details)
    return {**details, TRACKS: [_moved_track(track, motion) for track in details[TRACKS]]}


def _moved_track(track: Mapping[str, Any], motion: Float64) -> dict[str, Any]:
    if "motion" not in track:
        return dict(track)
    return {**track, "motion": (motion @ np.array(track["motion"]) @ inverse(motion)).tolist()}
