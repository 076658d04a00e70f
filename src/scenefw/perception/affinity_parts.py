"""Parts of a depth image by a trained network of affinities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import ConfigError
from scenefw.perception.depth_parts import grown, large_parts, linked_parts
from scenefw.perception.points import world_points
from scenefw.perception.seen_parts import high_parts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.training_protocols import PartAffinityModel, TrainedPartAffinity
    from scenefw.core.types import Frame, Int32

_WIDTH = 640  # pixels of the image that `smallest` is for


class AffinityParts:
    """Cuts a depth image above the floor where a network finds different objects.

    Neighbouring pixels are joined where it says that they show the same object. Images are thinned
    to about the focal length that it learnt from; pixels in between take the part of the nearest
    one, and pixels that are joined to none the part that is nearest along the surface.

    Args:
        checkpoint: of a network of affinities.
        threshold: probability of the same object from which on pixels are joined.
        margin: points up to this height above the floor belong to it (m).
        smallest: parts of fewer pixels (of an image 640 wide) are dropped.
        lowest: parts that rise no higher above the floor (m) are noise of it.

    Raises:
        ConfigError: a threshold outside 0..1, a negative height, or fewer than 1 pixel.
    """

    def __init__(
        self,
        checkpoint: TrainedPartAffinity,
        threshold: float = 0.5,
        margin: float = 0.005,
        smallest: float = 60.0,
        lowest: float = 0.012,
    ) -> None:
        if not 0 < threshold < 1 or margin < 0 or smallest < 1 or lowest < 0:
            raise ConfigError(
                f"parts have threshold {threshold}, margin {margin}, smallest {smallest} and "
                f"lowest {lowest}; expected a probability, heights of 0 or more, and pixels"
            )
        self.model: PartAffinityModel = checkpoint.model
        self.metadata = dict(checkpoint.metadata)
        self.threshold, self.margin = threshold, margin
        self.smallest, self.lowest = smallest, lowest

    def segment(self, frame: Frame) -> Int32:
        """Parts (H, W), 0 = none, of a frame whose camera has its pose (floor z = 0)."""
        heights = world_points(frame)[..., 2]
        above = heights > self.margin  # NaN where no depth: not above
        step = max(1, round(frame.camera.fx / self.model.focal))
        across, down = self._links(frame, step)
        joined = linked_parts(above[::step, ::step], across, down)
        fewest = self.smallest * (frame.depth.shape[1] / _WIDTH) ** 2
        parts = large_parts(joined, max(1, round(fewest / step**2)))
        rows, columns = (np.arange(size) // step for size in frame.depth.shape)
        parts = np.where(above, parts[np.ix_(rows, columns)], 0).astype(np.int32)
        return high_parts(grown(parts, above, frame.depth), heights, self.lowest)

    @torch.no_grad()
    def _links(self, frame: Frame, step: int) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether each `step`-th pixel is joined to the next one on the right, and below."""
        device = next(self.model.parameters()).device  # type: ignore[attr-defined]
        camera = frame.camera
        depth = np.nan_to_num(frame.depth[::step, ::step])
        inner = np.array([[camera.fx, camera.fy, camera.cx, camera.cy]], np.float32) / step
        cameras = CameraBatch(
            depth.shape[1],
            depth.shape[0],
            torch.from_numpy(inner).to(device),
            torch.from_numpy(camera.T_world_camera[None].astype(np.float32)).to(device),
        )
        image = torch.from_numpy(np.ascontiguousarray(depth, np.float32))[None].to(device)
        same = self.model(image, cameras)[0].sigmoid().cpu().numpy() > self.threshold
        return same[0, :, :-1], same[1, :-1]
