"""Depth images of real things whose meshes and poses are known."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import DAMAGED
from scenefw.core.geometry import transform_points
from scenefw.core.types import Camera, Int32, Pose, TriangleMesh
from scenefw.data.files.readers import read_frame
from scenefw.matching.assignment import Assignment
from scenefw_annotated_views.annotations import AnnotatedObject, AnnotatedView, Silhouette
from scenefw_annotated_views.silhouettes import SolidViews
from scenefw_single_view_benchmarks.mesh_solids import read_closed

_SUFFIX = ".npz"


class PosedImages:
    """Images with poses, each a scene of its own, in the coordinates of its camera.

    An image `NAME.npz` holds its depth and intrinsics as any other, `obj_names` (N,) of its
    objects, `T_cam_obj` (N, 4, 4) from their meshes to the camera (m), and `instances` (H, W):
    1 .. N in this order. What other pixels show is unknown. If the poses say that the instances
    are in another order, they are taken in that order, and notes of the frame tell.

    Args:
        folder: of the images.
        meshes: folder of `NAME.ply` of each object, closed (m).

    Raises:
        ConfigError: no folder of meshes is given.
        InputError: there is no such image, or a mesh is missing.
    """

    split = "test"

    def __init__(self, folder: str | Path, meshes: str | Path | None) -> None:
        if meshes is None:
            raise ConfigError("posed images need the meshes of their objects; give meshes=FOLDER")
        self.folder, self.meshes = Path(folder), Path(meshes)
        self.paths = sorted(self.folder.glob(f"*{_SUFFIX}"))
        if not self.paths:
            raise InputError(f"{self.folder} holds no posed image {_SUFFIX}; give another folder")
        self._names = [self._read(path)["obj_names"].tolist() for path in self.paths]
        self.categories = tuple(sorted({name for names in self._names for name in names}))
        self._solids = {name: self._mesh(name) for name in self.categories}

    def __len__(self) -> int:
        """Number of images."""
        return len(self.paths)

    def keys(self, scene: int) -> list[Hashable]:
        """Names of the objects of an image."""
        return list(self._names[scene])

    def objects(self, scene: int) -> tuple[AnnotatedObject, ...]:
        """The objects of an image."""
        poses = self._read(self.paths[scene])["T_cam_obj"]
        return tuple(
            AnnotatedObject(
                name, self._solids[name], Pose.from_matrix(pose), self.categories.index(name)
            )
            for name, pose in zip(self._names[scene], poses, strict=True)
        )

    def views(self, scene: int, count: int = 1) -> Iterator[AnnotatedView]:
        """The image, whatever the count."""
        del count
        path, objects = self.paths[scene], self.objects(scene)
        instances: Int32 = self._read(path)["instances"].astype(np.int32)
        frame = read_frame(path)
        numbers = shown_by(instances, objects, frame.camera)
        if numbers != list(range(1, len(objects) + 1)):
            frame = replace(frame, notes=(*frame.notes, _note(path, numbers)))
        silhouettes = tuple(
            Silhouette(visible, visible, int(visible.sum()), None)
            for visible in (instances == number for number in numbers)
        )
        yield AnnotatedView(frame, objects, silhouettes, instances <= 0)

    def facts(self) -> dict[str, Any]:
        """What decides what they show."""
        return {"images": [path.name for path in self.paths], "meshes": list(self.categories)}

    def _read(self, path: Path) -> dict[str, Any]:
        try:
            with np.load(path, allow_pickle=False) as file:
                return {key: file[key] for key in ("obj_names", "T_cam_obj", "instances")}
        except (*DAMAGED, KeyError) as error:
            raise InputError(
                f"{path} is no posed image ({error}); expected obj_names, T_cam_obj and instances"
            ) from error

    def _mesh(self, name: str) -> TriangleMesh:
        path = self.meshes / f"{name}.ply"
        if not path.is_file():
            raise InputError(f"there is no mesh {path} of an object in {self.folder}; add it")
        return read_closed(path)


def shown_by(instances: Int32, objects: Sequence[AnnotatedObject], camera: Camera) -> list[int]:
    """Number of the instance that shows each object, by where its mesh is in the image.

    Args:
        instances: (H, W), an object each where positive.
        objects: as many, or more.
        camera: of the image.
    """
    meshes = [
        TriangleMesh(transform_points(item.pose.matrix, item.mesh.vertices), item.mesh.faces)
        for item in objects
    ]
    silhouettes = SolidViews(meshes).see(camera)[1]
    masks = np.stack([instances == number for number in range(1, len(objects) + 1)])
    outlines = np.stack([silhouette.mask for silhouette in silhouettes])
    shared = np.einsum("ihw,jhw->ij", masks.astype(np.float32), outlines.astype(np.float32))
    union = masks.sum((1, 2))[:, None] + outlines.sum((1, 2))[None] - shared
    rows, columns = Assignment().assign(-shared / np.maximum(union, 1)).T
    numbers = dict(zip(columns.tolist(), (rows + 1).tolist(), strict=True))
    return [numbers[column] for column in range(len(objects))]


def _note(path: Path, numbers: Sequence[int]) -> str:
    return (
        f"{path.name}: its poses say that objects 1 to {len(numbers)} are instances "
        f"{', '.join(map(str, numbers))}, which are taken for them"
    )
