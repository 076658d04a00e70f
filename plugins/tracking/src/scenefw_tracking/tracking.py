"""Follows the objects of a scene over depth images given as arrays or files."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.api.image import image_of
from scenefw.api.prediction import Prediction
from scenefw.api.settings import Settings
from scenefw.data.files.camera_pose import camera_pose_of
from scenefw.perception.estimate.base_frame import with_camera_in_base
from scenefw_tracking.tracker import Tracker

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from scenefw.data.files.camera_pose import CameraPose
    from scenefw.data.files.intrinsics import Intrinsics
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.pipeline import ReconstructionPipeline


class Tracking:
    """What `Predictor.track` and `scenefw.load("tracking")` give: objects keep their ids.

    Args:
        pipeline: makes the scene of one image.
        computing: threads compute within what it returns.
    """

    def __init__(
        self,
        pipeline: ReconstructionPipeline[Observation],
        computing: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self.tracker = Tracker(pipeline)
        self._computing = computing
        self._count = 0

    @classmethod
    def built(cls, words: Sequence[str]) -> Tracking:
        """The tracking of a predictor of `run=predict` with these overrides."""
        settings = Settings(["run=predict", *words])
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
        name: str | None = None,
    ) -> Prediction:
        """Complete objects after the next image, in the world frame of the first one.

        `tracks` of the prediction says what each object does. Only what has changed is
        reconstructed; an image that is refused changes nothing.

        Args:
            depth: (H, W), as of `Predictor.predict`; of the same camera as the images before.
            intrinsics: as there.
            color: as there.
            mask: (H, W) bool, where objects are. Ids would say already which object is which.
            camera_pose: of the camera in a robot's base, with each image or with none. Where it has
                moved, everything is reconstructed anew, and objects are found again in the base.
                Without it, the camera must stand still.
            depth_scale: as there.
            name: of the image, for `tracks`, messages and files; None: `image_1`, `image_2` ...

        Raises:
            InputError: the image is unusable, or of another size or camera; the message says how to
                fix it.
        """
        pose = camera_pose_of(camera_pose)
        name = name or f"image_{self._count + 1}"
        frame, object_mask = image_of(depth, intrinsics, color, mask, depth_scale, name)
        with self._computing():
            scene = self.tracker.track(frame, object_mask, pose)
        self._count += 1
        for warning in scene.warnings:
            warnings.warn(f"{frame.name}: {warning}", stacklevel=2)
        return Prediction(tuple(with_camera_in_base(item, pose) for item in scene.scenes))
