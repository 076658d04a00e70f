"""Ways from an image to objects with shapes: pipelines, and references that learn nothing."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.observation.image_turns import turned, turned_pixels
from scenefw.perception.observation.object_masks import footprint_hull
from scenefw_single_view_benchmarks.labelled_masks import pixel_instances

if TYPE_CHECKING:
    from scenefw.core.types import Camera, Float64, Int32, ObjectEstimate, TriangleMesh
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.pipeline import ReconstructionPipeline
    from scenefw.perception.steps import Segmentation


_VERTICAL = 1e-9  # m, horizontally: no side of what is looked at from above is behind


@dataclass(frozen=True, eq=False)
class PredictedScene:
    """Objects of an image in the frame of their floor.

    Args:
        objects: in the order of their ids.
        masks: (H, W) id of the object that each pixel of the image shows, 0 = none.
        camera: of the image, above the floor.
    """

    objects: tuple[ObjectEstimate, ...]
    masks: Int32
    camera: Camera


def pipeline_scenes(
    pipeline: ReconstructionPipeline[Observation], view: Observation, count: int = 1
) -> list[PredictedScene]:
    """At most `count` hypotheses of a pipeline, the most typical one first.

    Args:
        pipeline: reconstructs; it makes at least as many hypotheses as it makes by itself.
        view: that it has observed.
        count: of hypotheses.
    """
    pipeline = copy.copy(pipeline)
    pipeline.samples = max(count, pipeline.samples)
    estimates = pipeline.reconstruct(view, first_only=count == 1)[:count]
    return [
        PredictedScene(estimate.objects, pixel_instances(estimate), estimate.frame.camera)
        for estimate in estimates
    ]


class VisibleHulls:
    """The hull of the visible points of each object, without voxels and without learning.

    Points are completed by their footprints on the floor, and by their mirror images behind the
    vertical plane across the line of sight, half way between the nearest and the farthest point.

    Args:
        segmentation: finds objects where nobody has marked them.
        mirror: mirror images too.
    """

    def __init__(self, segmentation: Segmentation, *, mirror: bool = False) -> None:
        self.segmentation, self.mirror = segmentation, mirror

    def scene(self, view: Observation) -> PredictedScene:
        """The only hypothesis."""
        segments = self.segmentation.segment(view) if view.masks is None else view.masks
        if view.masks is not None and view.ids:
            segments = np.array([0, *view.ids], np.int32)[segments]
        meshes: dict[int, TriangleMesh] = {}
        for label in np.unique(segments[segments > 0]).tolist():
            points = view.points[(segments == label) & np.isfinite(view.points[..., 2])]
            if self.mirror and len(points):
                points = with_mirror_images(points, view.eye)
            mesh = footprint_hull(points)
            if mesh is not None:
                meshes[label] = mesh
        image = view.frame if view.workspace is None else view.workspace.frame
        return PredictedScene(
            estimate_objects(meshes, dict.fromkeys(meshes, 1.0)),
            turned_pixels(segments, -view.turns),
            turned(image, -view.turns).camera,
        )


def with_mirror_images(points: Float64, eye: Float64) -> Float64:
    """Points (N, 3) and their mirror images behind what is seen (2N, 3).

    Args:
        points: visible, above the floor z = 0 (m).
        eye: (3,) where they are seen from (m).
    """
    ahead = (points.mean(axis=0) - eye) * (1, 1, 0)
    ahead /= max(float(np.linalg.norm(ahead)), _VERTICAL)
    depth = points @ ahead
    middle = (depth.min() + depth.max()) / 2
    return np.concatenate([points, points + 2 * (middle - depth)[:, None] * ahead])
