"""What a network of affinities says about the pixels of a depth image."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.special import logit

from scenefw.core.batches import CameraBatch

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from scenefw.core.part_protocols import PartAffinityModel
    from scenefw.core.types import Float32, Float64, Frame

_MIN_PROBABILITY = 1e-3  # of a single pixel, or one less it


@dataclass(frozen=True, eq=False)
class PixelProbabilities:
    """Of an image that is thinned to about the focal length that a network learnt from.

    Args:
        step: every so many pixels one was taken, along both sides.
        across: (H', W' - 1) that a pixel shows the same object as its right neighbour.
        down: (H' - 1, W') the same for the one below.
        objects: (H', W') that a pixel shows an object; None: the network doesn't say it.
        obstacles: (H', W') that it shows an obstacle; None: likewise.
    """

    step: int
    across: Float32
    down: Float32
    objects: Float32 | None
    obstacles: Float32 | None


@torch.no_grad()
def pixel_probabilities(model: PartAffinityModel, frame: Frame) -> PixelProbabilities:
    """The probabilities of a frame whose floor is z = 0."""
    camera, step = frame.camera, max(1, round(frame.camera.fx / model.focal))
    device = next(model.parameters()).device  # type: ignore[attr-defined]
    depth = np.ascontiguousarray(np.nan_to_num(frame.depth[::step, ::step]), np.float32)
    intrinsics = np.array([[camera.fx, camera.fy, camera.cx, camera.cy]], np.float32) / step
    cameras = CameraBatch(
        depth.shape[1],
        depth.shape[0],
        torch.from_numpy(intrinsics).to(device),
        torch.from_numpy(camera.T_world_camera[None].astype(np.float32)).to(device),
    )
    colour = None
    if frame.colour is not None:
        colour = torch.tensor(frame.colour[::step, ::step], device=device)
        colour = colour.permute(2, 0, 1)[None] / 255
    logits = model(torch.from_numpy(depth)[None].to(device), cameras, colour)[0]
    across, down, *further_answers = logits.sigmoid().cpu().numpy()
    objects = None if model.shown is None else further_answers.pop(0)
    obstacles = None if model.obstacles is None else further_answers.pop(0)
    return PixelProbabilities(step, across[:, :-1], down[:-1], objects, obstacles)


def log_odds(probabilities: ArrayLike) -> Float64:
    """Of the probabilities of single pixels; a network that is surer of them isn't believed."""
    return np.asarray(logit(np.clip(probabilities, _MIN_PROBABILITY, 1 - _MIN_PROBABILITY)))
