"""Camera poses of RGB-D sequences without any, by Open3D's odometry (Park et al. 2017)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.settings import POSITIVE, SHARE
from scenefw.core.types import Frame
from scenefw.representations.open3d_library import require_open3d

_METHODS = {"hybrid": "Hybrid", "intensity": "Intensity", "point_to_plane": "PointToPlane"}


class RGBDOdometry:
    """Poses relative to the first camera, from each frame to the next; errors add up.

    The world is the first camera's frame: rectify it by the floor found in the first frame.

    Args:
        method: hybrid (depth and colour), intensity or point_to_plane.
        largest_depth: pixels farther away (m) are not used.
        largest_difference: pixels whose depths differ by more (m) don't correspond.
        least_fitness: share of pixels that must correspond, else tracking is lost.
        iterations: per resolution, coarse to fine.

    Raises:
        ConfigError: an unknown method, or a number out of range.
    """

    def __init__(
        self,
        method: str = "hybrid",
        largest_depth: float = 3.0,
        largest_difference: float = 0.03,
        least_fitness: float = 0.3,
        iterations: tuple[int, ...] = (20, 10, 5),
    ) -> None:
        if method not in _METHODS:
            raise ConfigError(f"odometry has no method {method}; give one of {', '.join(_METHODS)}")
        POSITIVE.require(largest_depth=largest_depth, largest_difference=largest_difference)
        SHARE.require(least_fitness=least_fitness)
        self.method = method
        self.largest_depth, self.largest_difference = largest_depth, largest_difference
        self.least_fitness, self.iterations = least_fitness, tuple(iterations)

    def track(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames with poses relative to the first camera; existing poses are ignored.

        Raises:
            InputError: a frame without colour or of another size, or tracking is lost.
            MissingDependencyError: Open3D is not installed.
        """
        o3d = require_open3d("odometry")
        pose, before, first = np.eye(4), None, None
        for index, frame in enumerate(frames):
            first = first or frame
            if frame.depth.shape != first.depth.shape:
                raise InputError(
                    f"frame {frame.name or index} has shape {frame.depth.shape}, the first one "
                    f"{first.depth.shape}; all frames of a sequence must have the same size"
                )
            now = self._image(o3d, frame, index)
            if before is not None:
                pose = pose @ self._step(o3d, now, before, frame, index)
            before = now
            yield replace(frame, camera=frame.camera.moved(pose))

    def _image(self, o3d: ModuleType, frame: Frame, index: int) -> Any:
        if frame.colour is None and self.method != "point_to_plane":
            raise InputError(
                f"frame {frame.name or index} has no colour, which odometry by '{self.method}' "
                "needs; give odometry.method=point_to_plane"
            )
        colour = frame.colour
        if colour is None:
            colour = np.zeros((*frame.depth.shape, 3), np.uint8)
        images = (colour.astype(np.float32) / 255, frame.depth.astype(np.float32)[..., None])
        tensors = (o3d.core.Tensor(np.ascontiguousarray(image)) for image in images)
        return o3d.t.geometry.RGBDImage(*(o3d.t.geometry.Image(tensor) for tensor in tensors))

    def _step(
        self, o3d: ModuleType, now: Any, before: Any, frame: Frame, index: int
    ) -> NDArray[np.float64]:
        """From this camera's coordinates to those of the one before."""
        odometry = o3d.t.pipelines.odometry
        try:
            result = odometry.rgbd_odometry_multi_scale(
                now,
                before,
                o3d.core.Tensor(frame.camera.matrix),
                depth_scale=1.0,
                depth_max=self.largest_depth,
                criteria_list=[odometry.OdometryConvergenceCriteria(n) for n in self.iterations],
                method=getattr(odometry.Method, _METHODS[self.method]),
                params=odometry.OdometryLossParams(depth_outlier_trunc=self.largest_difference),
            )
        except RuntimeError as error:
            raise _lost(frame, index, str(error).splitlines()[0]) from error
        step = np.asarray(result.transformation.numpy(), dtype=np.float64)
        if not np.isfinite(step).all() or result.fitness < self.least_fitness:
            raise _lost(frame, index, f"{result.fitness:.0%} of the pixels correspond")
        return step


def _lost(frame: Frame, index: int, reason: str) -> InputError:
    return InputError(
        f"tracking was lost at frame {frame.name or index} ({reason}); cut the sequence before it, "
        "record with slower motion, or give poses"
    )
