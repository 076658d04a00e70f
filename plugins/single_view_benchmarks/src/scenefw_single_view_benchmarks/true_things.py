"""What is true of an image whose objects are known: masks, and shapes with what is seen of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Frame, TriangleMesh
from scenefw.matching.assignment import Assignment
from scenefw.matching.costs import overlaps
from scenefw.perception.observation.points import world_points
from scenefw_single_view_benchmarks.object_shapes import SolidShape, visible_points

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Int32
    from scenefw_annotated_views.annotations import AnnotatedView
    from scenefw_single_view_benchmarks.shape_methods import PredictedScene

_WIDTH = 640  # pixels, of the image that least numbers of pixels are of
_RISING = 0.005  # m above the floor: what is higher is one object to the trivial mask


@dataclass(frozen=True, eq=False)
class TrueThings:
    """The objects of an image, numbered from 1 on.

    Args:
        labels: (H, W) what a pixel shows: 0 nothing, -1 unknown, no depth, or hardly seen.
        marks: (H, W) the objects that are seen well enough, 0 = none of them.
        shapes: of these, by number.
        visible: which points of a shape the camera sees, by number.
        all_shapes: shapes of all objects, by number.
        kinds: names of those that are seen well enough.
        depth: (H, W) of the image (m).
        camera: of the image, in the coordinates of the shapes.
    """

    labels: Int32
    marks: Int32
    shapes: Mapping[int, SolidShape]
    visible: Mapping[int, NDArray[np.bool_]]
    all_shapes: Mapping[int, SolidShape]
    kinds: tuple[str, ...]
    depth: Float32
    camera: Camera

    @classmethod
    def of(cls, view: AnnotatedView, min_pixels: float, voxel: float) -> TrueThings:
        """What is true of a view.

        Args:
            view: with all its objects.
            min_pixels: of an image 640 wide: an object of fewer counts for nothing.
            voxel: side of the voxels of shapes (m).
        """
        depth, camera = view.frame.depth, view.frame.camera
        fewest = max(min_pixels * (depth.shape[1] / _WIDTH) ** 2, 1)
        marks = np.zeros(depth.shape, np.int32)
        labels = np.zeros(depth.shape, np.int32)
        all_shapes, kinds = {}, []
        for number, (item, shown) in enumerate(
            zip(view.objects, view.silhouettes, strict=True), start=1
        ):
            vertices = transform_points(item.pose.matrix, item.mesh.vertices)
            all_shapes[number] = SolidShape(TriangleMesh(vertices, item.mesh.faces), voxel)
            is_visible = shown.visible.sum() >= fewest
            labels[shown.visible] = number if is_visible else -1
            if is_visible:
                marks[shown.visible] = number
                kinds.append(str(item.key))
        labels[depth <= 0] = -1
        if view.unknown is not None:
            labels[view.unknown] = -1
        shapes = {number: all_shapes[number] for number in np.unique(marks[marks > 0]).tolist()}
        visible = {n: visible_points(shape, marks == n, camera) for n, shape in shapes.items()}
        return cls(labels, marks, shapes, visible, all_shapes, tuple(kinds), depth, camera)

    def in_true_frame(self, scene: PredictedScene) -> dict[int, TriangleMesh]:
        """Predicted surfaces in the coordinates of the true ones, by id."""
        motion = self.camera.T_world_camera @ inverse(scene.camera.T_world_camera)
        return {
            item.id: TriangleMesh(transform_points(motion, item.mesh.vertices), item.mesh.faces)
            for item in scene.objects
        }

    def matches(self, scene: PredictedScene) -> dict[int, int]:
        """Id of the predicted object whose pixels fit each true one best, if they share any."""
        is_known = self.labels >= 0
        shared = overlaps(np.where(is_known, scene.masks, 0), np.where(is_known, self.labels, 0))
        pairs = Assignment().assign(-shared.iou)
        return {
            int(shared.true[column]): int(shared.predicted[row])
            for row, column in pairs
            if shared.shared[row, column]
        }

    def rising(self, scene: PredictedScene | None) -> Int32:
        """(H, W) the trivial mask: all that rises above the floor that a scene stands on is one."""
        if scene is None:
            return np.zeros_like(self.labels)
        heights = world_points(Frame(self.depth, scene.camera))[..., 2]
        return (heights > _RISING).astype(np.int32)  # NaN where no depth: not above
