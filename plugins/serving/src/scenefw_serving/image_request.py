"""A request about one depth image."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from scenefw.core.errors import InputError
from scenefw.perception.estimate.base_frame import with_camera_in_base

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Frame, Int32, SceneEstimate
    from scenefw.perception.pipeline import ReconstructionPipeline


@dataclass(frozen=True)
class ImageRequest:
    """An image, and what a request asks about it.

    Args:
        frame: as read.
        predictions: makes its scenes.
        mask: (H, W) where objects are known to be, or which one a pixel shows; or None.
        sample: which hypothesis is asked for.
        camera_pose: (4, 4) of the camera in a robot's base; None: answers are in the floor's frame.
    """

    frame: Frame
    predictions: Predictions
    mask: NDArray[np.bool_] | Int32 | None = None
    sample: int = 0
    camera_pose: Float64 | None = None

    def scenes(self) -> Sequence[SceneEstimate]:
        """All hypotheses, the most typical one first.

        Raises:
            InputError: the image is unusable.
        """
        scenes = self.predictions.of(self.frame, self.mask)
        return [with_camera_in_base(scene, self.camera_pose) for scene in scenes]

    def scene(self) -> SceneEstimate:
        """The hypothesis that is asked for.

        Raises:
            InputError: the image is unusable, or there is no such hypothesis.
        """
        return self.chosen(self.scenes())

    def chosen(self, scenes: Sequence[SceneEstimate]) -> SceneEstimate:
        """One of several scenes.

        Raises:
            InputError: there is no such scene.
        """
        if not 0 <= self.sample < len(scenes):
            raise InputError(
                f"there is no sample {self.sample}; give one of 0 to {len(scenes) - 1}"
            )
        return scenes[self.sample]


class Predictions:
    """Scenes of images, the last of which are remembered.

    Args:
        pipeline: makes them.
        remembered: images at most.
    """

    def __init__(self, pipeline: ReconstructionPipeline, remembered: int = 4) -> None:
        self.pipeline, self.remembered = pipeline, remembered
        self._scenes: OrderedDict[str, tuple[SceneEstimate, ...]] = OrderedDict()

    def of(self, frame: Frame, mask: Any = None) -> tuple[SceneEstimate, ...]:
        """All hypotheses of an image.

        Raises:
            InputError: the image is unusable.
        """
        key = _content(frame, mask)
        scenes = self._scenes.pop(key, None)
        if scenes is None:
            view = self.pipeline.observe(frame, mask)
            scenes = tuple(self.pipeline.reconstruct(view))
        self._scenes[key] = scenes
        while len(self._scenes) > self.remembered:
            self._scenes.popitem(last=False)
        return scenes


def _content(frame: Frame, mask: Any) -> str:
    """A name of all that a prediction depends on."""
    camera = frame.camera.matrix
    digest = hashlib.sha256(repr((frame.name, frame.notes)).encode())
    for array in (frame.depth, camera, frame.colour, mask):
        if array is None:
            digest.update(b"none")
        else:
            digest.update(f"{array.shape}{array.dtype}".encode() + array.tobytes())
    return digest.hexdigest()
