"""Reads the `scene.json` of a prediction back; nothing in it is run."""

from __future__ import annotations

import json
import warnings
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import inverse
from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    ObjectEstimate,
    Obstacle,
    PlacedShape,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.data.files.structured import read_text
from scenefw.perception.estimate.base_frame import (
    CAMERA_IN_BASE,
    FLOOR_IN_BASE,
    floor_pose,
    moved_details,
    on_floor,
)
from scenefw.perception.estimate.transforms import moved_obstacle
from scenefw.perception.observation.object_masks import MAX_ID
from scenefw.shapes.solid_mesh import closed
from scenefw.shapes.superellipsoid import Superellipsoid
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel
from scenefw_editing.scene_editing import with_objects

if TYPE_CHECKING:
    from scenefw.core.types import Int32, Shape

SCENE = "scene.json"
MASKS = "masks.png"
_ORTHONORMAL_TOLERANCE = 1e-3  # of rotations and the length of quaternions
_SCENE_KEYS = ("name", "objects", "obstacles", "camera", "support_graph", "versions")
"""The other keys are details."""
_KINDS = ("superquadric", "superellipsoid", "vessel")


def read_scene(path: str | Path) -> SceneEstimate:
    """A scene as `run=predict`, `run=edit` and `save("scene.json")` write it.

    Objects are read from the meshes beside the file; where one has none, its shape's surface is
    taken. A shape of a kind that is unknown here, as of a plugin, is left out with a warning, and
    its object is its mesh. Volumes are made of them. The depth image isn't stored: that of the
    frame is empty.

    Objects that were written in a robot's base are brought back to the frame of the floor.

    Args:
        path: `scene.json`, or the folder that holds it.

    Raises:
        InputError: there is no such file, it is damaged, or an object has neither mesh nor shape.
    """
    path = Path(path)
    path = path / SCENE if path.is_dir() else path
    record = _read_json(path)
    try:
        items = record["objects"]
        objects = tuple(_object(item, path) for item in items)
        camera = _camera(record["camera"])
        obstacles = tuple(_obstacle(item, path) for item in record.get("obstacles", ()))
        name, grid = str(record["name"]), _grid(record.get("grid", {}))
    except (KeyError, TypeError, ValueError, AttributeError, ConfigError) as error:
        raise InputError(
            f"{path} isn't a scenefw scene, or damaged ({type(error).__name__}: {error}); give a "
            "scene.json that run=predict wrote"
        ) from error
    ids = [item.id for item in objects]
    if len({*ids}) < len(ids) or not all(1 <= label <= MAX_ID for label in ids):
        raise InputError(f"{path} has objects {ids}; expected different ids from 1 to {MAX_ID}")
    frame = Frame(np.zeros((camera.height, camera.width), np.float32), camera, name=name)
    volume = np.full(grid.shape, grid.truncation, dtype=np.float32)
    details = {key: value for key, value in record.items() if key not in _SCENE_KEYS}
    empty = SceneEstimate(
        (), grid, volume, np.zeros(grid.shape, np.int32), frame, details, {}, None
    )
    floor = _from_base(replace(empty, objects=objects, obstacles=obstacles))
    scene = with_objects(replace(floor, objects=()), floor.objects)
    return replace(scene, details=floor.details, masks=_masks(path, camera))


def _from_base(estimate: SceneEstimate) -> SceneEstimate:
    """What `in_base` made, as it was before."""
    if FLOOR_IN_BASE not in estimate.details:
        return estimate
    motion = inverse(floor_pose(estimate.details))
    camera = estimate.frame.camera
    details = {k: v for k, v in estimate.details.items() if k != FLOOR_IN_BASE}
    return replace(
        estimate,
        objects=tuple(on_floor(estimate)),
        obstacles=tuple(moved_obstacle(item, motion) for item in estimate.obstacles),
        frame=replace(estimate.frame, camera=camera.moved(motion @ camera.T_world_camera)),
        details={
            **moved_details(details, motion),
            CAMERA_IN_BASE: np.array(camera.T_world_camera).tolist(),
        },
    )


def _read_json(path: Path) -> dict[str, Any]:
    if not path.exists():
        raise InputError(f"there is no {path}; give a scene.json that run=predict wrote")
    try:
        record = json.loads(read_text(path))
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path} can't be read as JSON ({str(error).splitlines()[0]}); give a scene.json that "
            "run=predict wrote"
        ) from error
    if not isinstance(record, dict) or not {"name", "objects", "camera"} <= record.keys():
        raise InputError(
            f"{path} lacks name, objects or camera; give a scene.json that run=predict wrote"
        )
    return record


def _object(record: dict[str, Any], path: Path) -> ObjectEstimate:
    label = int(record["id"])
    shape = record.get("shape")
    try:
        placed = None if _is_foreign(shape) else _placed_shape(shape)
    except InputError as error:
        raise InputError(
            f"the shape of object {label} in {path} is invalid ({error}); predict the scene again"
        ) from error
    if record.get("mesh") is not None:
        if shape is not None and _is_foreign(shape):
            warnings.warn(
                f"object {label} of {path} has a shape of kind {shape['kind']!r}, which isn't "
                f"known here ({', '.join(_KINDS)} are); its mesh is read alone",
                stacklevel=2,
            )
        mesh = _mesh(str(record["mesh"]), path, label)
    elif placed is not None:
        mesh = placed.mesh()
    else:
        raise InputError(
            f"object {label} of {path} has neither a mesh file nor a shape of a known kind "
            f"({', '.join(_KINDS)}); predict it again with run=predict, which writes both"
        )
    return ObjectEstimate(
        label,
        mesh,
        _pose(record["pose"]),
        _numbers(record["extents"], 3),
        float(record["confidence"]),
        placed,
    )


def _obstacle(record: dict[str, Any], path: Path) -> Obstacle:
    return Obstacle(str(record["kind"]), _surface(str(record["mesh"]), path, "an obstacle"))


def _mesh(name: str, path: Path, label: int) -> TriangleMesh:
    mesh = _surface(name, path, f"object {label}")
    if not closed(mesh):
        raise InputError(
            f"mesh {path.parent / name} is not closed, so it has no inside; predict the scene again"
        )
    return mesh


def _surface(name: str, path: Path, owner: str) -> TriangleMesh:
    import trimesh

    if Path(name).name != name or not name.lower().endswith(".ply"):
        raise InputError(f"{owner} of {path} has the mesh '{name}'; expected NAME.ply there")
    file = path.parent / name
    try:
        with file.open("rb") as stream:
            surface = trimesh.load(stream, file_type="ply", process=False)
    except FileNotFoundError as error:
        raise InputError(
            f"there is no {file}, the mesh of {owner}; keep the files of a scene together"
        ) from error
    except Exception as error:  # trimesh passes on whatever its reader raises
        raise InputError(f"mesh {file} can't be read ({error}); predict the scene again") from error
    if not isinstance(surface, trimesh.Trimesh):
        raise InputError(f"mesh {file} holds no triangles; predict the scene again")
    mesh = TriangleMesh(
        np.asarray(surface.vertices, np.float64), np.asarray(surface.faces, np.int64)
    )
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"mesh {file} has vertices that are no numbers; predict the scene again")
    return mesh


def _is_foreign(record: dict[str, Any] | None) -> bool:
    return record is not None and record["kind"] not in _KINDS


def _placed_shape(record: dict[str, Any] | None) -> PlacedShape | None:
    if record is None:
        return None
    shape: Shape
    if record["kind"] == "superquadric":
        shape = Superquadric(_numbers(record["half_axes"], 3), _numbers(record["exponents"], 3))
    elif record["kind"] == "superellipsoid":
        axes = _numbers(record["half_axes"], 3)
        shape = Superellipsoid(axes, float(record["e1"]), float(record["e2"]))
    else:
        shape = Vessel(**{field.name: float(record[field.name]) for field in fields(Vessel)})
    return PlacedShape(shape, _pose(record))


def _pose(record: dict[str, Any]) -> Pose:
    quaternion = _numbers(record["quaternion"], 4)
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > _ORTHONORMAL_TOLERANCE:
        raise ValueError(f"quaternion {quaternion.tolist()} is not of length 1")
    return Pose(_numbers(record["position"], 3), quaternion / length)


def _camera(record: dict[str, Any]) -> Camera:
    pose = np.array(record["T_world_camera"], dtype=np.float64)
    rotation = pose[:3, :3] if pose.shape == (4, 4) else np.zeros((3, 3))
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHONORMAL_TOLERANCE)
    if not rigid or not np.isfinite(pose).all() or not np.allclose(pose[3], (0, 0, 0, 1)):
        raise ValueError("T_world_camera is no rigid 4 x 4 matrix")
    width, height = int(record["width"]), int(record["height"])
    if not (0 < width <= 20000 and 0 < height <= 20000):
        raise ValueError(f"the camera has {width} x {height} pixels")
    intrinsics = [float(record[name]) for name in ("fx", "fy", "cx", "cy")]
    if not np.isfinite(intrinsics).all() or min(intrinsics[:2]) <= 0:
        raise ValueError(f"the camera has fx, fy, cx, cy = {intrinsics}")
    return Camera(width, height, intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3], pose)


def _grid(record: dict[str, Any]) -> GridSpec:
    values = {field.name: record[field.name] for field in fields(GridSpec) if field.name in record}
    if not 2 <= int(values.get("resolution", 64)) <= 512:
        raise ValueError(f"the grid has {values['resolution']} voxels per side")
    return GridSpec(**values)


def _masks(path: Path, camera: Camera) -> Int32 | None:
    from PIL import Image

    file = path.parent / MASKS
    if not file.is_file():
        return None
    try:
        with Image.open(file, formats=["PNG"]) as image:
            masks = np.asarray(image).astype(np.int32)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{file} can't be read ({error}); remove it, or predict again") from error
    return masks if masks.shape == (camera.height, camera.width) else None


def _numbers(values: Any, count: int) -> Any:
    array = np.array(values, dtype=np.float64)
    if array.shape != (count,) or not np.isfinite(array).all():
        raise ValueError(f"{values} are not {count} numbers")
    return array
