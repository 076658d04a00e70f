"""Scenes as messages of ROS, in its own field names; ROS itself isn't needed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

from scenefw.core.files import write_text
from scenefw.core.types import Pose
from scenefw.perception.estimate.base_frame import FLOOR_IN_BASE, floor_pose
from scenefw_simulators.bodies import BodyMaker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import CollisionShapes
    from scenefw.core.types import Float64, SceneEstimate, TriangleMesh
    from scenefw.export.meshes import Colour

_ADD = 0  # moveit_msgs/CollisionObject.ADD
_BOX = 1  # shape_msgs/SolidPrimitive.BOX
_TABLE_THICKNESS = 0.02  # m; MoveIt plans around solids, not planes
_DIGITS = 6  # of metres: a micrometre

_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


class PlanningScene:
    """`moveit_msgs/PlanningScene`, a difference: a CollisionObject per object, obstacle and table.

    Objects are the convex parts that `collision` makes of them, obstacles what is seen of them, the
    table a box below the floor as wide as the reconstructed cube. The same is written as JSON and,
    beside it, as YAML, as `ros2 topic pub` takes it.

    Args:
        frame_id: of the headers; None = `base_link` in a robot's base, else `table`.
        collision: says what touches; None = one convex hull each.
    """

    suffix = ".planning_scene.json"

    def __init__(
        self, frame_id: str | None = None, collision: CollisionShapes | None = None
    ) -> None:
        self.frame_id = frame_id
        self._maker = BodyMaker(collision=collision)

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes both files.

        Raises:
            InputError: an object has no volume.
            StorageError: a file can't be written.
        """
        head = header(estimate, self.frame_id)
        items = [
            _collision_object(head, body.name, body.pose, body.collision)
            for body in self._maker.bodies(estimate)
        ]
        here = Pose.from_matrix(np.eye(4))
        for number, obstacle in enumerate(estimate.obstacles, start=1):
            items.append(_collision_object(head, f"obstacle_{number:02d}", here, [obstacle.mesh]))
        items.append(_table(head, estimate))
        world = {"collision_objects": items}
        message = {"is_diff": True, "robot_state": {"is_diff": True}, "world": world}
        write_message(path, message)


class Detections:
    """`vision_msgs/Detection3DArray`: pose, box and confidence of each object.

    A pose is that of the box, whose sides are `extents`. Its covariance is unknown: zeros. The same
    is written as JSON and, beside it, as YAML.

    Args:
        frame_id: of the headers; None = `base_link` in a robot's base, else `table`.
        class_id: of all hypotheses; what objects are is not known.
    """

    suffix = ".detections.json"

    def __init__(self, frame_id: str | None = None, class_id: str = "object") -> None:
        self.frame_id, self.class_id = frame_id, class_id

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes both files.

        Raises:
            StorageError: a file can't be written.
        """
        head = header(estimate, self.frame_id)
        detections = []
        for item in estimate.objects:
            pose = _pose(item.pose)
            hypothesis = {"class_id": self.class_id, "score": float(item.confidence)}
            detections.append(
                {
                    "header": head,
                    "results": [
                        {
                            "hypothesis": hypothesis,
                            "pose": {"pose": pose, "covariance": [0.0] * 36},
                        }
                    ],
                    "bbox": {"center": pose, "size": _point(item.extents)},
                    "id": f"object_{item.id:02d}",
                }
            )
        write_message(path, {"header": head, "detections": detections})


def header(estimate: SceneEstimate, frame_id: str | None) -> dict[str, Any]:
    """`std_msgs/Header` with the time 0, which is the latest to tf."""
    in_base = FLOOR_IN_BASE in estimate.details
    name = frame_id or ("base_link" if in_base else "table")
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": name}


def write_message(path: Path, message: Mapping[str, Any]) -> None:
    """Writes a message as JSON, and as YAML beside it."""
    write_text(path, json.dumps(message, allow_nan=False) + "\n")
    plain = json.loads(json.dumps(message))  # no two parts are one: YAML would refer to the first
    write_text(path.with_suffix(".yaml"), yaml.dump(plain, Dumper=_Dumper, sort_keys=False))


def _collision_object(
    head: Mapping[str, Any], name: str, pose: Pose, meshes: Sequence[TriangleMesh]
) -> dict[str, Any]:
    return {
        "header": head,
        "pose": _pose(pose),
        "id": name,
        "meshes": [_mesh(mesh) for mesh in meshes],
        "mesh_poses": [_pose(Pose.from_matrix(np.eye(4))) for _ in meshes],
        "operation": _ADD,
    }


def _table(head: Mapping[str, Any], estimate: SceneEstimate) -> dict[str, Any]:
    side = estimate.grid.extent
    below = np.eye(4)
    below[:2, 3] = np.array(estimate.grid.lower[:2]) + side / 2
    below[2, 3] = -_TABLE_THICKNESS / 2
    box = {"type": _BOX, "dimensions": [side, side, _TABLE_THICKNESS]}
    return {
        "header": head,
        "pose": _pose(Pose.from_matrix(floor_pose(estimate.details) @ below)),
        "id": "table",
        "primitives": [box],
        "primitive_poses": [_pose(Pose.from_matrix(np.eye(4)))],
        "operation": _ADD,
    }


def _mesh(mesh: TriangleMesh) -> dict[str, Any]:
    return {
        "triangles": [{"vertex_indices": face} for face in mesh.faces.tolist()],
        "vertices": [_point(vertex) for vertex in mesh.vertices],
    }


def _pose(pose: Pose) -> dict[str, Any]:
    w, x, y, z = (float(part) for part in pose.quaternion)
    return {"position": _point(pose.position), "orientation": {"x": x, "y": y, "z": z, "w": w}}


def _point(place: Float64) -> dict[str, float]:
    return {axis: round(float(part), _DIGITS) for axis, part in zip("xyz", place, strict=True)}
