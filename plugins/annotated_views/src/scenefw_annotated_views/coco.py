"""COCO: images with masks of instances, those of whole objects beside them (Lin et al. 2014)."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw_annotated_views.annotation_files import (
    DEPTH_UNIT,
    read_json,
    scene_folders,
    write_frame,
    write_json,
)
from scenefw_annotated_views.annotations import AnnotatedScenes, AnnotatedView, Silhouette

_PART = "annotations.json"


class COCO:
    """A data set in the format of COCO: images in folders of scenes, one file of annotations.

    `segmentation` is of what is visible, as uncompressed run lengths. Beside the usual keys an
    annotation has `amodal_segmentation` and `amodal_bbox` of the object, were it alone,
    `visibility`, the visible share of it, also of what is outside the image, and `object_id`, the
    same in all images. Objects that nothing is seen of have no annotation. Images have
    `depth_file_name` and `depth_scale` (m per unit); without colour, `file_name` is that of depth.
    """

    def write_scene(
        self, folder: Path, views: Iterable[AnnotatedView], numbers: Sequence[int]
    ) -> None:
        """Writes a scene into an empty folder.

        Raises:
            StorageError: a file can't be written.
        """
        images, annotations = [], []
        for number, view in enumerate(views):
            name = f"{number:06d}"
            write_frame(folder, name, view)
            kind = "depth" if view.frame.colour is None else "rgb"
            camera = view.frame.camera
            images.append(
                {
                    "file_name": f"{kind}/{name}.png",
                    "depth_file_name": f"depth/{name}.png",
                    "depth_scale": DEPTH_UNIT,
                    "width": camera.width,
                    "height": camera.height,
                    "K": camera.matrix.tolist(),
                    "T_world_camera": camera.T_world_camera.tolist(),
                }
            )
            for item, silhouette, model in zip(
                view.objects, view.silhouettes, numbers, strict=True
            ):
                if silhouette.visible.any():
                    ids = {"image": number, "category_id": item.category + 1, "object_id": model}
                    annotations.append(ids | _annotation(silhouette))
        write_json(folder / _PART, {"images": images, "annotations": annotations})

    def finish(self, root: Path, scenes: AnnotatedScenes, numbers: Mapping[Hashable, int]) -> None:
        """Writes `annotations_SPLIT.json`.

        Raises:
            StorageError: it can't be written, or annotations of a scene are damaged.
        """
        images: list[dict[str, Any]] = []
        annotations: list[dict[str, Any]] = []
        for folder in scene_folders(root, scenes.split):
            part, first = read_json(folder / _PART), len(images) + 1
            for image in part["images"]:
                for key in ("file_name", "depth_file_name"):
                    image[key] = f"{scenes.split}/{folder.name}/{image[key]}"
                images.append({"id": len(images) + 1, "scene_id": int(folder.name), **image})
            for annotation in part["annotations"]:
                image_id = first + annotation.pop("image")
                annotations.append({"id": len(annotations) + 1, "image_id": image_id, **annotation})
        categories = [
            {"id": number, "name": name, "supercategory": "object"}
            for number, name in enumerate(scenes.categories, start=1)
        ]
        write_json(
            root / f"annotations_{scenes.split}.json",
            {
                "info": {"description": f"scenefw, split {scenes.split}", "version": "1.0"},
                "licenses": [],
                "categories": categories,
                "images": images,
                "annotations": annotations,
            },
        )


def _annotation(silhouette: Silhouette) -> dict[str, Any]:
    return {
        "iscrowd": 0,
        "area": int(silhouette.visible.sum()),
        "bbox": _box(silhouette.visible),
        "segmentation": run_lengths(silhouette.visible),
        "amodal_bbox": _box(silhouette.mask),
        "amodal_segmentation": run_lengths(silhouette.mask),
        "visibility": silhouette.visibility,
    }


def _box(mask: NDArray[np.bool_]) -> list[int]:
    """Left, top, width and height of pixels."""
    rows, columns = np.nonzero(mask)
    left, top = int(columns.min()), int(rows.min())
    return [left, top, int(columns.max()) - left + 1, int(rows.max()) - top + 1]


def run_lengths(mask: NDArray[np.bool_]) -> dict[str, list[int]]:
    """COCO's uncompressed run lengths of a mask (H, W): down the columns, 0 first."""
    flat = mask.ravel(order="F")
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    ends = np.concatenate([[0], changes, [flat.size]])
    counts = np.diff(ends).tolist()
    return {"size": list(mask.shape), "counts": [0, *counts] if flat[0] else counts}
