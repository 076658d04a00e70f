"""What networks of sets may see: a complete scene, or one view of it."""

from abc import ABC, abstractmethod

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction

CHANNELS = {"occupancy": 1, "view": 2}
"""Of the complete occupancy, or of distances and what was observed."""


class VolumeDecomposer(nn.Module, ABC):
    """A network from the one volume that it sees to a set of objects; nothing is drawn.

    Args:
        sees: occupancy, the complete scene; or view, the partial TSDF of one depth image.
        resolution: voxels per side.

    Raises:
        ConfigError: there is no such thing to see.
    """

    training_only = ()
    latent_shape = ()

    def __init__(self, sees: str, resolution: int) -> None:
        super().__init__()
        if sees not in CHANNELS:
            raise ConfigError(f"model.sees is {sees!r}; expected {' or '.join(CHANNELS)}")
        self.sees, self.resolution = sees, resolution

    @abstractmethod
    def objects_of(self, volume: Tensor) -> ObjectSetPrediction:
        """Objects of a volume of the right shape."""

    def forward(
        self, batch: ObjectSetBatch, generator: torch.Generator | None = None
    ) -> ObjectSetPrediction:
        """Objects of a batch; nothing is drawn, so the generator is not used."""
        return self.decompose(batch.occupancy if self.sees == "occupancy" else batch.condition)

    def decompose(self, volume: Tensor) -> ObjectSetPrediction:
        """Objects of what the network sees.

        Args:
            volume: (B, 1, X, Y, Z) occupancy, or (B, 2, X, Y, Z) as `ObjectSetBatch.condition`.

        Raises:
            InputError: it has another shape.
        """
        expected_shape = (CHANNELS[self.sees], *(self.resolution,) * 3)
        if tuple(volume.shape[1:]) != expected_shape:
            raise InputError(
                f"the network sees volumes (B, {', '.join(map(str, expected_shape))}), got "
                f"{tuple(volume.shape)}; use the grid of the checkpoint"
            )
        return self.objects_of(volume)
