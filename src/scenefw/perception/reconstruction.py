"""A trained network as a method that turns partial views into complete, segmented scenes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import torch

from scenefw.core.errors import InputError
from scenefw.data.conditioning import condition

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from scenefw.core.protocols import InstanceExtractor
    from scenefw.core.types import GridSpec, PartialTSDF


class TrainedNetwork(Protocol):
    """What a loaded checkpoint gives (`learning.checkpoint.load_checkpoint`)."""

    model: Any
    grid: GridSpec
    observed: bool
    metadata: Mapping[str, Any]


class NetworkReconstructor:
    """Completes partial TSDFs with a trained network and several latent codes.

    The first sample decodes the zero code, the most typical scene; the others draw from N(0, I).

    Args:
        checkpoint: a loaded checkpoint; its grid is the grid of everything here.
        extractor: from TSDF and centre votes to instances.
        device: where the network runs.
    """

    def __init__(
        self, checkpoint: TrainedNetwork, extractor: InstanceExtractor, device: str = "cpu"
    ) -> None:
        self.grid = checkpoint.grid
        self.observed = checkpoint.observed
        self.metadata = dict(checkpoint.metadata)
        self.extractor = extractor
        self.device = torch.device(device)
        self.model = checkpoint.model.to(self.device).eval()

    @torch.no_grad()
    def volumes(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[tuple[Tensor, Tensor]]:
        """`samples` pairs of TSDF (B, X, Y, Z) in metres and votes (B, 3, X, Y, Z).

        Raises:
            InputError: the grid is not the one that the network was trained on.
        """
        if grid != self.grid:
            raise InputError(
                f"the network was trained on {self.grid}, the view is on {grid}; fuse it on the "
                "checkpoint's grid, or give another checkpoint"
            )
        inputs = condition(partial, grid, observed=self.observed)
        inputs = inputs.to(self.device, memory_format=_memory_format(self.device))
        shape = (len(inputs), self.model.latent_size)
        results = []
        for sample in range(samples):
            latent = torch.zeros(shape) if sample == 0 else torch.randn(shape, generator=generator)
            prediction = self.model.predict(inputs, latent.to(self.device))
            tsdf = prediction.tsdf[:, 0].float().clamp(-1, 1) * grid.truncation
            results.append((tsdf, prediction.votes.float()))
        return results

    def reconstruct(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[tuple[Tensor, Tensor]]:
        """`samples` pairs of TSDF (B, X, Y, Z) in metres and instances (B, X, Y, Z) int32."""
        results = []
        for tsdf, votes in self.volumes(partial, grid, samples, generator):
            instances = [
                self.extractor.extract(distance, vote, grid)[0]
                for distance, vote in zip(tsdf, votes, strict=True)
            ]
            results.append((tsdf, torch.stack(instances)))
        return results


def _memory_format(device: torch.device) -> torch.memory_format:
    return torch.channels_last_3d if device.type == "cuda" else torch.contiguous_format
