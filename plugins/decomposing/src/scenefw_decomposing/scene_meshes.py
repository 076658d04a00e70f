"""The surface of a whole scene from a mesh file, as scanners and fusion of depth images give it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.files import unreadable
from scenefw.core.types import Float64, TriangleMesh

MESHES = (".ply", ".obj", ".stl", ".off", ".glb", ".gltf")
_Y_UP = (".glb", ".gltf")  # by their standard
_COMPRESSIONS = ("draco", "meshopt")  # in names of glTF's extensions
_WITH_COUNT = {
    ".ply": re.compile(rb"^element\s+face\s+(\d+)", re.MULTILINE),
    ".off": re.compile(rb"\A\s*\w*OFF\b(?:\s|#[^\n]*\n)+\d+\s+(\d+)"),
}
"""Where a format's header says how many faces follow."""
_MAX_WIDTH = 20.0  # m: what is wider was given in millimetres
_MIN_WIDTH = 0.02  # m
_SCALE_SETTING = "run.mesh_scale (from Python: mesh_scale)="


def is_mesh(path: Path) -> bool:
    """Whether the name is that of a mesh file."""
    return path.suffix.lower() in MESHES


def read_scene_mesh(path: Path | str, scale: float = 1.0) -> tuple[TriangleMesh, Float64]:
    """The triangles of a scene, z up, in metres, and (4, 4) how they come of the file's numbers.

    glTF files are y up by their standard and are turned.

    Args:
        path: .ply, .obj, .stl, .off, .glb or .gltf.
        scale: metres per unit of the file.

    Raises:
        InputError: the file is missing, damaged or without triangles, or of another unit.
    """
    import trimesh

    path = Path(path)
    if not path.is_file():
        raise InputError(f"no file {path}; give input=PATH of a mesh ({', '.join(MESHES)})")
    try:
        if path.suffix.lower() in _Y_UP:
            _require_plain(path)
        scene = trimesh.load_scene(path, process=False, skip_materials=True)
        _require_vertices(path, scene)
        mesh = scene.to_mesh()
    except InputError:
        raise
    except Exception as error:  # trimesh passes on whatever its readers raise
        raise InputError(f"cannot read {path}: {unreadable(error, 'is it a mesh?')}") from error
    T = np.diag([scale, scale, scale, 1.0])  # noqa: N806
    if path.suffix.lower() in _Y_UP:
        x, y, z = np.eye(3)
        T = geometry.rigid(np.column_stack([x, z, -y]), np.zeros(3)) @ T  # noqa: N806
    vertices = geometry.transform_points(T, mesh.vertices)
    faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
    if len(faces) < _least_faces(path):
        raise InputError(f"{path} holds no mesh, or only the beginning of one; copy it again")
    if not len(faces):
        raise InputError(
            f"{path} has no triangles; make a surface of its points first, or give depth images"
        )
    _require_metres(path, vertices)
    return TriangleMesh(vertices, faces), T


def _require_plain(path: Path) -> None:
    """That a glTF file is not compressed, and its numbers are in it or in files beside it.

    Pictures are not read, so they may be missing.
    """
    header = _gltf_header(path)
    for name in header.get("extensionsRequired", ()):
        if any(compression in name.lower() for compression in _COMPRESSIONS):
            raise InputError(f"{path} needs {name}; export without Draco or meshopt compression")
    buffers = [buffer for buffer in header.get("buffers", ()) if isinstance(buffer, dict)]
    for uri in [buffer["uri"] for buffer in buffers if "uri" in buffer]:
        if "base64," not in uri and not _is_beside(path, uri):
            raise InputError(
                f"{path} has its numbers in {uri[:99]!r}, which is no plain file in its "
                "folder; copy that file there, or export as .glb"
            )


def _gltf_header(path: Path) -> Any:
    with path.open("rb") as file:
        if path.suffix.lower() == ".glb":  # 12 bytes, then length and kind of the header
            file.seek(12)
            data = file.read(int.from_bytes(file.read(8)[:4], "little"))
        else:
            data = file.read()
    return json.loads(data)


def _is_beside(path: Path, uri: str) -> bool:
    """Whether what trimesh opens, by a whole name or the last part of it, is a plain file."""
    folder, name = path.parent.resolve(), uri.strip()
    for candidate in (name, name.lstrip("/"), Path(uri).name):
        file = (folder / candidate).resolve()
        if file.is_relative_to(folder) and file.exists():
            return file.is_file()
    return False


def _require_vertices(path: Path, scene: Any) -> None:
    """That faces are of vertices that there are."""
    from trimesh import Trimesh

    for part in scene.geometry.values():
        if not isinstance(part, Trimesh):  # points alone
            continue
        faces, count = np.asarray(part.faces), len(part.vertices)
        if faces.size and not 0 <= faces.min() <= faces.max() < count:
            raise InputError(
                f"{path} has faces of vertices {faces.min()} to {faces.max()}, but {count} "
                "vertices from 0 on; export it again"
            )


def _least_faces(path: Path) -> int:
    """Faces that a file of this format has at least: as its header says, or one."""
    suffix = path.suffix.lower()
    if suffix not in _WITH_COUNT:
        return 1 if suffix == ".stl" else 0  # which can't hold points alone
    match = _WITH_COUNT[suffix].search(path.read_bytes())
    return int(match[1]) if match else 0


def _require_metres(path: Path, vertices: np.ndarray) -> None:
    if not np.isfinite(vertices).all():
        raise InputError(f"{path} has vertices that are not numbers; export it again without them")
    width = float(np.ptp(vertices, axis=0).max())
    if width > _MAX_WIDTH:
        raise InputError(
            f"{path} is {width:.0f} m wide; if it is in millimetres, give {_SCALE_SETTING}0.001, "
            "in centimetres 0.01"
        )
    if width < _MIN_WIDTH:
        raise InputError(
            f"{path} is only {width * 1000:.1f} mm wide; expected a scene in metres: give "
            f"{_SCALE_SETTING}METRES_PER_UNIT"
        )
