"""Methods that count: the trained network, and the base rate that looks at nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import torch

from scenefw.data.batches.conditioning import condition, require_grid
from scenefw_object_count.data import counts

if TYPE_CHECKING:
    from collections.abc import Mapping

    from torch import Tensor

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.types import GridSpec
    from scenefw.data.batches.stacks import StackScenes
    from scenefw_object_count.network import CountNetwork


class Counter(Protocol):
    """From partial views to distributions over numbers of objects."""

    @property
    def grid(self) -> GridSpec | None:
        """Of its views; None if it takes any."""

    def probabilities(self, partial: PartialTSDF, grid: GridSpec) -> Tensor:
        """Probabilities (B, N) of 1, 2, ..., N objects, float64 on the CPU."""


class TrainedNetwork(Protocol):
    """What a loaded checkpoint gives (`scenefw.learning.checkpoint.load_checkpoint`)."""

    model: CountNetwork
    grid: GridSpec
    metadata: Mapping[str, Any]


class NetworkCounter:
    """The distribution that a trained network gives.

    Args:
        checkpoint: a loaded checkpoint of the task object_count.
        device: where the network runs.
    """

    def __init__(self, checkpoint: TrainedNetwork, device: str = "cpu") -> None:
        self.grid, self.metadata = checkpoint.grid, dict(checkpoint.metadata)
        self.device = torch.device(device)
        self.model = checkpoint.model.to(self.device).eval()

    @torch.no_grad()
    def probabilities(self, partial: PartialTSDF, grid: GridSpec) -> Tensor:
        """Probabilities (B, N) of 1, 2, ..., N objects, float64 on the CPU.

        Raises:
            InputError: the grid is not the one that the network was trained on.
        """
        require_grid(grid, self.grid)
        scores: Tensor = self.model(condition(partial, grid).to(self.device))
        return scores.double().softmax(dim=1).cpu()


class BaseRate:
    """How often each number occurs in the training scenes, whatever the view shows.

    Args:
        scenes: of the training split.
        most: largest number that gets a probability.
    """

    def __init__(self, scenes: StackScenes, most: int = 8) -> None:
        frequencies = torch.bincount(counts(scenes), minlength=most + 1)[1 : most + 1].double()
        # One more of each (Laplace): a number that a small sample lacks is rare, not impossible.
        self.rates = (frequencies + 1) / (frequencies + 1).sum()

    @property
    def grid(self) -> None:
        """It takes any."""
        return None

    def probabilities(self, partial: PartialTSDF, grid: GridSpec) -> Tensor:
        """The same probabilities (B, N) for each view."""
        return self.rates.expand(len(partial.distance), -1)
