"""Reads the `scene.json` of a prediction back; nothing in it is run."""

from __future__ import annotations

import json
import warnings
from dataclasses import fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    ObjectEstimate,
    PlacedShape,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.perception.editing.scene_editing import with_objects
from scenefw.shapes.solid_mesh import closed
from scenefw.shapes.superellipsoid import Superellipsoid
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from scenefw.core.types import Int32, Shape

SCENE = "scene.json"
MASKS = "masks.png"
_OWN = ("name", "objects", "camera", "versions")  # the other keys are details
_KINDS = ("superquadric", "superellipsoid", "vessel")
_MOST_BYTES = 64 * 2**20
_MOST_IDS = 9999
_ORTHONORMAL = 1e-3


def read_scene(path: str | Path) -> SceneEstimate:
    """A scene as `run=predict`, `run=edit` and `save("scene.json")` write it.

    Objects are read from the meshes beside the file; where one has none, its shape's surface is
    taken. A shape of a kind that is unknown here, as of a plugin, is left out with a warning, and
    its object is its mesh. Volumes are made of them. The depth image isn't stored: that of the
    frame is empty.

    Args:
        path: `scene.json`, or the folder that holds it.

    Raises:
        InputError: there is no such file, it is damaged, or an object has neither mesh nor shape.
    """
    path = Path(path)
    path = path / SCENE if path.is_dir() else path
    told = _read(path)
    try:
        items = told["objects"]
        objects = tuple(_object(item, path) for item in items)
        camera = _camera(told["camera"])
        name, grid = str(told["name"]), _grid(told.get("grid", {}))
    except (KeyError, TypeError, ValueError, AttributeError, ConfigError) as error:
        raise InputError(
            f"{path} isn't a scenefw scene, or damaged ({type(error).__name__}: {error}); give a "
            "scene.json that run=predict wrote"
        ) from error
    ids = [item.id for item in objects]
    if len({*ids}) < len(ids) or not all(1 <= label <= _MOST_IDS for label in ids):
        raise InputError(f"{path} has objects {ids}; expected different ids from 1 to {_MOST_IDS}")
    frame = Frame(np.zeros((camera.height, camera.width), np.float32), camera, name=name)
    volume = np.full(grid.shape, grid.truncation, dtype=np.float32)
    details = {key: value for key, value in told.items() if key not in _OWN}
    empty = SceneEstimate(
        (), grid, volume, np.zeros(grid.shape, np.int32), frame, details, {}, None
    )
    made = with_objects(empty, objects)
    return replace(made, details=details, masks=_masks(path, camera))


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path} is larger than 64 MiB, so no scene.json")
        told = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"there is no {path}; give a scene.json that run=predict wrote") from error
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(
            f"{path} can't be read as JSON ({str(error).splitlines()[0]}); give a scene.json that "
            "run=predict wrote"
        ) from error
    if not isinstance(told, dict) or not {"name", "objects", "camera"} <= told.keys():
        raise InputError(
            f"{path} lacks name, objects or camera; give a scene.json that run=predict wrote"
        )
    return told


def _object(told: dict[str, Any], path: Path) -> ObjectEstimate:
    label = int(told["id"])
    shape = told.get("shape")
    try:
        placed = None if _is_foreign(shape) else _placed(shape)
    except InputError as error:
        raise InputError(
            f"the shape of object {label} in {path} is invalid ({error}); predict the scene again"
        ) from error
    if told.get("mesh") is not None:
        if shape is not None and _is_foreign(shape):
            warnings.warn(
                f"object {label} of {path} has a shape of kind {shape['kind']!r}, which isn't "
                f"known here ({', '.join(_KINDS)} are); its mesh is read alone",
                stacklevel=2,
            )
        mesh = _mesh(str(told["mesh"]), path, label)
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
        _pose(told["pose"]),
        _numbers(told["extents"], 3),
        float(told["confidence"]),
        placed,
    )


def _mesh(name: str, path: Path, label: int) -> TriangleMesh:
    import trimesh

    if Path(name).name != name or not name.lower().endswith(".ply"):
        raise InputError(f"object {label} of {path} has the mesh '{name}'; expected NAME.ply there")
    file = path.parent / name
    try:
        with file.open("rb") as stream:
            read = trimesh.load(stream, file_type="ply", process=False)
    except FileNotFoundError as error:
        raise InputError(
            f"there is no {file}, the mesh of object {label}; keep the files of a scene together"
        ) from error
    except Exception as error:  # trimesh passes on whatever its reader raises
        raise InputError(f"mesh {file} can't be read ({error}); predict the scene again") from error
    if not isinstance(read, trimesh.Trimesh):
        raise InputError(f"mesh {file} holds no triangles; predict the scene again")
    mesh = TriangleMesh(np.asarray(read.vertices, np.float64), np.asarray(read.faces, np.int64))
    if not np.isfinite(mesh.vertices).all() or not closed(mesh):
        raise InputError(f"mesh {file} is not closed, so it has no inside; predict the scene again")
    return mesh


def _is_foreign(told: dict[str, Any] | None) -> bool:
    return told is not None and told["kind"] not in _KINDS


def _placed(told: dict[str, Any] | None) -> PlacedShape | None:
    if told is None:
        return None
    shape: Shape
    if told["kind"] == "superquadric":
        shape = Superquadric(_numbers(told["half_axes"], 3), _numbers(told["exponents"], 3))
    elif told["kind"] == "superellipsoid":
        axes = _numbers(told["half_axes"], 3)
        shape = Superellipsoid(axes, float(told["e1"]), float(told["e2"]))
    else:
        shape = Vessel(**{one.name: float(told[one.name]) for one in fields(Vessel)})
    return PlacedShape(shape, _pose(told))


def _pose(told: dict[str, Any]) -> Pose:
    quaternion = _numbers(told["quaternion"], 4)
    length = float(np.linalg.norm(quaternion))
    if abs(length - 1) > _ORTHONORMAL:
        raise ValueError(f"quaternion {quaternion.tolist()} is not of length 1")
    return Pose(_numbers(told["position"], 3), quaternion / length)


def _camera(told: dict[str, Any]) -> Camera:
    pose = np.array(told["T_world_camera"], dtype=np.float64)
    rotation = pose[:3, :3] if pose.shape == (4, 4) else np.zeros((3, 3))
    rigid = np.allclose(rotation @ rotation.T, np.eye(3), atol=_ORTHONORMAL)
    if not rigid or not np.isfinite(pose).all() or not np.allclose(pose[3], (0, 0, 0, 1)):
        raise ValueError("T_world_camera is no rigid 4 x 4 matrix")
    width, height = int(told["width"]), int(told["height"])
    if not (0 < width <= 20000 and 0 < height <= 20000):
        raise ValueError(f"the camera has {width} x {height} pixels")
    lens = [float(told[name]) for name in ("fx", "fy", "cx", "cy")]
    if not np.isfinite(lens).all() or min(lens[:2]) <= 0:
        raise ValueError(f"the camera has fx, fy, cx, cy = {lens}")
    return Camera(width, height, lens[0], lens[1], lens[2], lens[3], pose)


def _grid(told: dict[str, Any]) -> GridSpec:
    known = {one.name: told[one.name] for one in fields(GridSpec) if one.name in told}
    if not 2 <= int(known.get("resolution", 64)) <= 512:
        raise ValueError(f"the grid has {known['resolution']} voxels per side")
    return GridSpec(**known)


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
