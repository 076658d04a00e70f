"""Completes the objects of depth images given as arrays or files."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from scenefw.api.image import image_of
from scenefw.api.prediction import Prediction
from scenefw.core.errors import ConfigError
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.perception.estimate.base_frame import with_camera_in_base

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from scenefw.api.settings import Settings
    from scenefw.data.files.camera_pose import CameraPose
    from scenefw.data.files.intrinsics import Intrinsics
    from scenefw.perception.pipeline import ReconstructionPipeline


class Tracking(Protocol):
    """What `Predictor.track` gives."""

    def predict(
        self,
        depth: ArrayLike | str | Path,
        intrinsics: Intrinsics | None = None,
        color: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        *,
        camera_pose: CameraPose = None,
        depth_scale: float | None = None,
        name: str | None = None,
    ) -> Prediction:
        """Complete objects after the next image; `tracks` says what each does."""


class Predictor:
    """What `scenefw.load("reconstruction")` gives.

    Args:
        pipeline: makes the scene of an image.
        computing: threads compute within what it returns.
    """

    def __init__(
        self,
        pipeline: ReconstructionPipeline,
        computing: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.pipeline = pipeline
        self._computing = computing

    @classmethod
    def built(cls, settings: Settings) -> Predictor:
        """The predictor of `run=predict` with these settings."""
        (pipeline,) = settings.build("run.pipeline")
        return cls(pipeline, settings.computing)

    def predict(
        self,
        depth: ArrayLike | str | Path,
        intrinsics: Intrinsics | None = None,
        color: ArrayLike | None = None,
        mask: ArrayLike | None = None,
        *,
        camera_pose: CameraPose = None,
        depth_scale: float | None = None,
        name: str = "image",
    ) -> Prediction:
        """Complete objects of one depth image, as `run=predict` finds them.

        What looks odd about the image is warned of, and in `warnings` of the prediction.

        Args:
            depth: (H, W) z-depth: floats are metres, integers are multiplied by `depth_scale`, and
                0 and NaN are missing; or the path of an image, as of `input` on the command line.
            intrinsics: of this image size: K (3, 3), the numbers fx fy cx cy, a dict of them, a
                `Camera` or a file. May be None only if `depth` is a file that has them beside it.
            color: (H, W, 3) uint8, aligned with the depth; helps to find where objects end, and is
                kept with the result.
            mask: (H, W) of what is known to be objects: booleans say where some are, whole numbers
                which one a pixel shows (0 = none), and objects keep these ids. Anything else above
                the floor is then ignored.
            camera_pose: of the camera in a robot's base, 4x4 or what else
                `data.files.camera_pose.camera_pose_of` takes; what is saved is then in the base.
            depth_scale: metres per unit of integer depth; None = 0.001, or that of a file's format.
                An error with floats, which are metres.
            name: of the image, for messages and files.

        Raises:
            InputError: the image is unusable; the message says how to fix it.
        """
        pose = camera_pose_of(camera_pose)
        frame, object_mask = image_of(depth, intrinsics, color, mask, depth_scale, name)
        with self._computing():
            view = self.pipeline.observe(frame, object_mask)
            for warning in view.warnings:
                warnings.warn(f"{frame.name}: {warning}", stacklevel=2)
            scenes = self.pipeline.reconstruct(view)
            scenes = [with_camera_in_base(scene, pose) for scene in scenes]
            for warning in scenes[0].details["warnings"][len(view.warnings) :]:
                warnings.warn(f"{frame.name}: {warning}", stacklevel=2)
            return Prediction(tuple(scenes))

    def track(self) -> Tracking:
        """What takes the images of a scene in their order; objects keep their ids.

        Raises:
            ConfigError: the plugin `tracking` is missing.
        """
        from scenefw.api.load import loaders

        source = loaders().get("tracking")
        if source is None:
            raise ConfigError(
                "track() needs the plugin tracking, which is missing; install scenefw with its "
                "plugins"
            )
        tracking: Tracking = source(self.pipeline, self._computing)
        return tracking
