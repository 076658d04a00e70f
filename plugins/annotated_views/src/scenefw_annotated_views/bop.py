"""BOP: views with 6D poses, masks and models, as that benchmark has them (Hodan et al. 2018)."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.distance import cdist

from scenefw.core.files import write_text
from scenefw.core.geometry import inverse
from scenefw.core.types import Camera, Float64, TriangleMesh
from scenefw_annotated_views.annotation_files import (
    DEPTH_UNIT,
    write_frame,
    write_image,
    write_json,
)
from scenefw_annotated_views.annotations import (
    AnnotatedObject,
    AnnotatedScenes,
    AnnotatedView,
    Box,
    Silhouette,
)

_MM = 1000.0
_AT_ONCE = 512  # rows of a matrix of distances


class BOP:
    """A data set in the format of BOP, one folder per scene.

    `SPLIT/000000/` has `depth/`, `rgb/` where there is colour, `mask/` (whole silhouettes),
    `mask_visib/`, `scene_camera.json`, `scene_gt.json` and `scene_gt_info.json`; `models/` one PLY
    per model and `models_info.json`; `camera.json` the camera. Lengths are in millimetres. The
    origin of a model is the middle of its bounding box. Visible is what the ray through a pixel's
    centre meets first; BOP's own toolkit estimates it from depth, with 15 mm to spare.
    """

    def write_scene(
        self, folder: Path, views: Iterable[AnnotatedView], numbers: Sequence[int]
    ) -> None:
        """Writes a scene into an empty folder.

        Raises:
            StorageError: a file can't be written.
        """
        cameras, truths, infos = {}, {}, {}
        for view_number, view in enumerate(views):
            name = f"{view_number:06d}"
            write_frame(folder, name, view)
            for number, silhouette in enumerate(view.silhouettes):
                for kind, mask in (("mask", silhouette.mask), ("mask_visib", silhouette.visible)):
                    file = folder / kind / f"{name}_{number:06d}.png"
                    write_image(file, mask.astype(np.uint8) * 255)
            camera = view.frame.camera
            cameras[view_number] = _camera(camera)
            truths[view_number] = [
                _pose(item, camera, number)
                for item, number in zip(view.objects, numbers, strict=True)
            ]
            measured = view.frame.depth > 0
            infos[view_number] = [_info(silhouette, measured) for silhouette in view.silhouettes]
        write_json(folder / "scene_camera.json", cameras)
        write_json(folder / "scene_gt.json", truths)
        write_json(folder / "scene_gt_info.json", infos)

    def finish(self, root: Path, scenes: AnnotatedScenes, numbers: Mapping[Hashable, int]) -> None:
        """Writes the models, `models_info.json` and `camera.json`.

        Raises:
            StorageError: a file can't be written.
        """
        infos: dict[int, dict[str, Any]] = {}
        kinds: dict[int, str] = {}
        for scene in track(range(len(scenes)), "models"):
            for item in scenes.objects(scene):
                number = numbers[item.key]
                if number not in infos:
                    mesh = _model(item)
                    _write_ply(root / "models" / f"obj_{number:06d}.ply", mesh)
                    infos[number] = _model_info(mesh, item.symmetries)
                    kinds[number] = scenes.categories[item.category]
        write_json(root / "models" / "models_info.json", dict(sorted(infos.items())))
        write_json(root / "models" / "categories.json", dict(sorted(kinds.items())))
        camera = next(iter(scenes.views(0, 1))).frame.camera
        values = {key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
        write_json(root / "camera.json", values | {"depth_scale": DEPTH_UNIT * _MM})


def _camera(camera: Camera) -> dict[str, Any]:
    to_camera = inverse(camera.T_world_camera)
    return {
        "cam_K": camera.matrix.ravel().tolist(),
        "depth_scale": DEPTH_UNIT * _MM,
        "cam_R_w2c": to_camera[:3, :3].ravel().tolist(),
        "cam_t_w2c": (to_camera[:3, 3] * _MM).tolist(),
    }


def _pose(item: AnnotatedObject, camera: Camera, number: int) -> dict[str, Any]:
    to_camera = inverse(camera.T_world_camera) @ item.pose.matrix
    place = to_camera[:3, :3] @ _middle(item.mesh) + to_camera[:3, 3]
    return {
        "cam_R_m2c": to_camera[:3, :3].ravel().tolist(),
        "cam_t_m2c": (place * _MM).tolist(),
        "obj_id": number,
    }


def _info(silhouette: Silhouette, measured: np.ndarray) -> dict[str, Any]:
    visible = int(silhouette.visible.sum())
    rows, columns = np.nonzero(silhouette.visible)
    visible_box = None
    if visible:
        visible_box = (int(columns.min()), int(rows.min()), int(columns.max()), int(rows.max()))
    return {
        "bbox_obj": _box(silhouette.box if visible else None),
        "bbox_visib": _box(visible_box),
        "px_count_all": silhouette.pixels,
        "px_count_valid": int((silhouette.mask & measured).sum()),
        "px_count_visib": visible,
        "visib_fract": silhouette.visibility,
    }


def _box(box: Box | None) -> list[int]:
    """As BOP's toolkit counts: width and height are differences of first and last pixel."""
    if box is None:
        return [-1, -1, -1, -1]
    left, top, right, bottom = box
    return [left, top, right - left, bottom - top]


def _middle(mesh: TriangleMesh) -> Float64:
    middle: Float64 = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return middle


def _model(item: AnnotatedObject) -> TriangleMesh:
    """The mesh in millimetres, about the middle of its box."""
    return TriangleMesh((item.mesh.vertices - _middle(item.mesh)) * _MM, item.mesh.faces)


def _model_info(mesh: TriangleMesh, symmetries: Float64 | None) -> dict[str, Any]:
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    info: dict[str, Any] = {"diameter": _diameter(mesh.vertices)}
    for axis, name in enumerate("xyz"):
        info[f"min_{name}"] = float(low[axis])
    for axis, name in enumerate("xyz"):
        info[f"size_{name}"] = float(high[axis] - low[axis])
    if symmetries is not None:
        turns = np.tile(np.eye(4), (len(symmetries), 1, 1))
        turns[:, :3, :3] = symmetries
        info["symmetries_discrete"] = turns.reshape(-1, 16).tolist()
    return info


def _diameter(points: Float64) -> float:
    """The largest distance of two points."""
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:  # all in a plane
        points = np.unique(points, axis=0)
    rows = range(0, len(points), _AT_ONCE)
    return max(float(cdist(points[row : row + _AT_ONCE], points).max()) for row in rows)


def _write_ply(path: Path, mesh: TriangleMesh) -> None:
    """PLY as text with normals of vertices, as BOP has them."""
    numbers = np.concatenate([mesh.vertices, _normals(mesh)], axis=1)
    properties = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    vertices = "\n".join(" ".join(f"{x:.5f}" for x in row) for row in numbers.tolist())
    faces = "\n".join(f"3 {a} {b} {c}" for a, b, c in mesh.faces.tolist())
    write_text(
        path,
        f"ply\nformat ascii 1.0\ncomment millimetres\nelement vertex {len(mesh.vertices)}\n"
        f"{properties}element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\n"
        f"end_header\n{vertices}\n{faces}\n",
    )


def _normals(mesh: TriangleMesh) -> Float64:
    """Unit normals (V, 3) of vertices, those of faces weighted by their angles."""
    corners = mesh.vertices[mesh.faces]
    of_faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    of_faces = _unit(of_faces)
    normals = np.zeros_like(mesh.vertices)
    for corner in range(3):
        first_edge = _unit(corners[:, (corner + 1) % 3] - corners[:, corner])
        second_edge = _unit(corners[:, (corner + 2) % 3] - corners[:, corner])
        angle = np.arccos(np.clip((first_edge * second_edge).sum(axis=1), -1, 1))
        np.add.at(normals, mesh.faces[:, corner], of_faces * angle[:, None])
    return _unit(normals)


def _unit(vectors: Float64) -> Float64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: Float64 = vectors / np.where(length > 0, length, 1)
    return unit
