"""Hypotheses in the order in which they explain the depth image."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.evidence.object_depth import object_depth
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import rays, world_points

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Float64, Frame, GridSpec, SceneEstimate
    from scenefw.perception.evidence.tolerances import Tolerances


class EvidenceRanking:
    """Ray-casts the objects of each scene and the floor, and compares with measured depth.

    The score is the mean of min(|d - d'| / point_sigma, outliers)^2 over pixels that show an object
    in the image or in the scene: a truncated Gaussian model of the sensor, so the least is the most
    likely scene. An object where the image sees past it counts as much as one that is missing. The
    first scene, the most typical one, stays the first: on 40 validation views of stacks it was
    better than the best explained draw (instance IoU of superquadrics 0.814 and 0.808; a draw has
    0.802 in the mean, the best of ten 0.826).

    `details["evidence"]` of each scene has `deviation` (the root of the score, standard
    deviations), `explained` (share of these pixels within `inlier_distance`) and `hypothesis`, its
    number before.

    Args:
        tolerances: how far measured points lie from a surface, and up to where they count as on it.
    """

    def __init__(self, tolerances: Tolerances) -> None:
        self.tolerances = tolerances

    def rank(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """The scenes of one image with their evidence: the first, then what explains it best."""
        if not scenes:
            return []
        measurement = _measure(scenes[0].frame, scenes[0].grid)
        candidates = [
            self._with_evidence(scene, number, measurement)
            for number, scene in enumerate(scenes, start=1)
        ]
        return candidates[:1] + sorted(candidates[1:], key=_deviation)

    def _with_evidence(
        self, scene: SceneEstimate, number: int, measurement: _Measurement
    ) -> SceneEstimate:
        predicted = measurement.floor.copy()
        for item in scene.objects:
            depth = object_depth(item.mesh, measurement.camera)
            front = np.where(depth.front > 0, depth.front, np.inf)
            predicted[depth.box] = np.minimum(predicted[depth.box], front)
        hit = predicted < measurement.floor
        errors = np.abs(predicted - measurement.depth)[measurement.inside]
        errors = errors[(measurement.objects | hit)[measurement.inside]]
        facts: dict[str, float | None] = {"deviation": None, "explained": None}
        if len(errors):
            squared = np.minimum(errors / self.tolerances.point_sigma, OUTLIERS) ** 2
            facts["deviation"] = float(np.sqrt(squared.mean()))
            facts["explained"] = self.tolerances.inlier_ratio(errors)
        facts["hypothesis"] = number
        return replace(scene, details={**scene.details, "evidence": facts})


@dataclass(frozen=True, eq=False)
class _Measurement:
    """Pixels (h, w) of an image: measured depth and that of the floor alone (m).

    And whether they show an object, and lie in the grid.
    """

    camera: Camera
    depth: Float32
    floor: Float64
    objects: NDArray[np.bool_]
    inside: NDArray[np.bool_]


def _measure(frame: Frame, grid: GridSpec) -> _Measurement:
    """What a frame in world coordinates shows."""
    camera, step = frame.camera, coarse_step(frame.camera.width)
    points = world_points(frame)[::step, ::step]
    voxels = grid.to_voxels(points)
    inside = ((voxels >= 0) & (voxels <= grid.resolution - 1)).all(axis=-1)  # not NaN either
    eye, slope = camera.T_world_camera[2, 3], rays(camera, step) @ camera.T_world_camera[2, :3]
    with np.errstate(divide="ignore"):
        floor = np.where(eye * slope < 0, -eye / slope, np.inf)
    objects = np.asarray(points[..., 2] > MAX_FLOOR_HEIGHT)
    depth = frame.depth[::step, ::step]
    return _Measurement(camera, depth, floor, objects, np.asarray(inside))


def _deviation(scene: SceneEstimate) -> float:
    deviation = scene.details["evidence"]["deviation"]
    return float("inf") if deviation is None else float(deviation)
