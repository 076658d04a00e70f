"""Noise of a structured-light depth camera: shadows, holes, lateral and axial noise, steps."""

import math

import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.core.errors import SettingError
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, SHARE, below
from scenefw.kernels import depth_noise
from scenefw.kernels.cameras import finite
from scenefw.kernels.compile import float32


class Kinect:
    """Disturbs depth like a projector with a camera beside it, in the order of the light's path.

    1. Background that the projector can't light, as something nearer stands before it, is lost: a
       shadow on the left of objects for a projector on the right.
    2. Grazing surfaces are lost, with a probability growing from 0 to 1 between two angles. Angles
       come from the depth image, so depth edges count as grazing and fray.
    3. Every pixel reads the depth of a spot shifted by Gaussian noise (Handa et al. 2014).
    4. Gaussian axial noise with the standard deviation that Nguyen et al. (2012) measured,
       0.0012 + 0.0019 (z - 0.4)^2 metres.
    5. Disparity is rounded to steps, so depth steps grow with z^2.
    6. Single pixels and depths out of range are lost.

    Args:
        baseline: from the camera to the projector on its right (m); negative for one on its left.
        disparity_step: smallest step of disparity (pixels of the given image).
        lateral: standard deviation of the lateral shift (pixels).
        axial: factor on the axial standard deviation; 0 switches it off.
        grazing_from: angle between ray and normal from which pixels are lost (degrees).
        grazing_to: angle from which all are lost (degrees).
        dropout: share of pixels lost at random.
        nearest: no measurement below this depth (m).
        farthest: no measurement beyond this depth (m).
        share: share of the images that are disturbed; the others pass as they are.
    """

    def __init__(
        self,
        baseline: float = 0.075,
        disparity_step: float = 0.125,
        lateral: float = 0.7,
        axial: float = 1.0,
        grazing_from: float = 75.0,
        grazing_to: float = 87.0,
        dropout: float = 0.002,
        nearest: float = 0.4,
        farthest: float = 8.0,
        share: float = 1.0,
    ) -> None:
        if not abs(baseline) > 0:
            raise SettingError("baseline", baseline, "metres other than 0")
        POSITIVE.require(disparity_step=disparity_step)
        NOT_NEGATIVE.require(lateral=lateral, axial=axial)
        below(grazing_to).require(grazing_from=grazing_from)
        below(farthest).require(nearest=nearest)
        SHARE.require(dropout=dropout, share=share)
        self.baseline, self.disparity_step = baseline, disparity_step
        self.lateral, self.axial = lateral, axial
        self.grazing_from, self.grazing_to = math.radians(grazing_from), math.radians(grazing_to)
        self.dropout, self.nearest, self.farthest, self.share = dropout, nearest, farthest, share

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0 unless something shifts onto it."""
        depth = finite(depth.float(), 0.0).contiguous()
        lit, noisy = torch.empty_like(depth), torch.empty_like(depth)
        size = (cameras.width, cameras.height)
        baseline, share = float32(self.baseline, self.share)
        grazing = float32(
            math.cos(self.grazing_from),
            math.cos(self.grazing_to),
            self.grazing_from,
            self.grazing_to - self.grazing_from,
        )
        depth_noise.light(
            len(depth) * cameras.height, depth.view(-1), cameras.intrinsics, seeds, lit.view(-1),
            size, baseline, grazing, share,
        )  # fmt: skip
        sensor = float32(
            self.lateral,
            self.axial,
            self.disparity_step,
            self.dropout,
            self.nearest,
            self.farthest,
        )
        depth_noise.measure(
            depth.numel(), lit.view(-1), cameras.intrinsics, seeds, noisy.view(-1),
            size, baseline, sensor, share,
        )  # fmt: skip
        return noisy
