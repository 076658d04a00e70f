"""scene.json: what a depth image shows and hides, in numbers."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.files import write_text
from scenefw.core.types import Camera, ObjectEstimate, PlacedShape, SceneEstimate
from scenefw.perception.physics.support_graph import supports_of


def summarise(
    estimate: SceneEstimate,
    mesh_files: Mapping[int, str],
    obstacle_files: Sequence[str] = (),
    versions: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Plain data of a scene estimate: metres, world frame (z up, floor z = 0).

    Of a scene that `perception.estimate.base_frame` has brought into a robot's base that is the
    world, and `T_base_floor` says where the frame of the floor, and with it the grid, lies.

    `objects` is a list of id, centre, extents along the axes of the pose, pose (position and
    quaternion w, x, y, z), confidence and mesh file; `obstacles` have their kind and mesh file;
    `camera` has intrinsics and the matrix from camera (OpenCV) to world coordinates;
    `support_graph` says what stands on what (0 = the floor), which objects fall if one is taken
    away, and the order in which to take them. Every further key comes from the estimate's details.

    Args:
        estimate: the scene.
        mesh_files: name of the mesh file of each object id, beside the JSON, if it has one.
        obstacle_files: names of the mesh files of the obstacles, in their order; none: left out.
        versions: of what computed it.
    """
    return {
        "name": estimate.frame.name,
        "objects": [_object(item, mesh_files.get(item.id)) for item in estimate.objects],
        "obstacles": [
            {"kind": obstacle.kind, "mesh": name}
            for obstacle, name in zip(estimate.obstacles, obstacle_files, strict=False)
        ],
        "camera": _camera(estimate.frame.camera),
        "support_graph": supports_of(estimate).facts(),
        **{key: plain(value) for key, value in estimate.details.items()},
        "versions": dict(versions or {}),
    }


def write_summary(
    path: Path,
    estimate: SceneEstimate,
    mesh_files: Mapping[int, str],
    obstacle_files: Sequence[str] = (),
    versions: Mapping[str, str] | None = None,
) -> None:
    """Writes `summarise` as JSON, atomically."""
    summary = summarise(estimate, mesh_files, obstacle_files, versions)
    write_text(path, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def plain(value: Any) -> Any:
    """The same data as JSON types: numbers, text, lists, dicts; NaN and infinity become None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, bool | int | str) or value is None:
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value)


def _object(item: ObjectEstimate, mesh_file: str | None) -> dict[str, Any]:
    return {
        "id": int(item.id),
        "centre": plain(item.pose.position),
        "extents": plain(np.asarray(item.extents)),
        "pose": {
            "position": plain(item.pose.position),
            "quaternion": plain(item.pose.quaternion),
        },
        "confidence": float(item.confidence),
        "mesh": mesh_file,
        "shape": None if item.placed is None else shape_numbers(item.placed),
    }


def shape_numbers(placed: PlacedShape) -> dict[str, Any]:
    """Plain data of a shape: its `kind`, its own numbers, `position` and `quaternion`."""
    shape: Any = placed.shape
    return {
        "kind": type(shape).__name__.lower(),
        **{field.name: plain(getattr(shape, field.name)) for field in fields(shape)},
        "position": plain(placed.pose.position),
        "quaternion": plain(placed.pose.quaternion),
    }


def _camera(camera: Camera) -> dict[str, Any]:
    names = ("width", "height", "fx", "fy", "cx", "cy")
    return {name: plain(getattr(camera, name)) for name in names} | {
        "T_world_camera": plain(camera.T_world_camera)
    }
