"""Noise of one of several sensors, drawn for each image."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.rng import Streams
from scenefw.core.settings import POSITIVE, SHARE

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch
    from scenefw.core.protocols import Noise


class OneOf:
    """Disturbs each image as one of several sensors would.

    Args:
        sensors: noise by name.
        share: share of the images that are disturbed.
        weights: how often each sensor is drawn, 1 for those not named.

    Raises:
        ConfigError: there is no sensor, a weight of none or that isn't positive, or a share that
            is none.
    """

    def __init__(
        self, sensors: Mapping[str, Noise], share: float, weights: Mapping[str, float] | None = None
    ) -> None:
        if not sensors:
            raise ConfigError("one_of has no sensors; name at least one")
        SHARE.require(share=share)
        weights = dict(weights or {})
        unknown = sorted(set(weights) - set(sensors))
        if unknown:
            raise SettingError("weights", unknown, f"names of {', '.join(sensors)}")
        POSITIVE.require(**{f"weights.{name}": weight for name, weight in weights.items()})
        self.sensors, self.share = dict(sensors), share
        self._limits = np.cumsum([weights.get(name, 1.0) for name in self.sensors])

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0."""
        lots = Streams.of(0, 1, indices=seeds.cpu().numpy()).uniform(2)
        drawn = np.searchsorted(self._limits, lots[:, 1] * self._limits[-1], side="right")
        choices = np.where(lots[:, 0] < self.share, drawn, -1)
        noisy = depth.float()
        for number, sensor in enumerate(self.sensors.values()):
            rows = torch.from_numpy(np.flatnonzero(choices == number)).to(depth.device)
            if len(rows):
                disturbed = sensor.apply(depth[rows], cameras.of(rows), seeds[rows])
                noisy = noisy.index_copy(0, rows, disturbed)
        return noisy
