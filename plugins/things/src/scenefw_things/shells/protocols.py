"""Protocols of networks that complete single objects: data, losses and networks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from scenefw.core.training_protocols import Loss, Network, TrainingData

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenefw.core.batches import IndexBatch
    from scenefw.core.types import Float64
    from scenefw_things.shells.batches import (
        ObjectCrops,
        ObjectShellBatch,
        ShellPrediction,
        ShellSetup,
    )


class ObjectShellData(TrainingData, Protocol):
    """Crops about objects, and their shells (group `dataset`, option `object_shells`)."""

    objects: int
    """Crops of an image."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectShellBatch:
        """Crops of images of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectShellBatch:
        """The same crops in every epoch."""

    def validation_solids(self, batch: IndexBatch) -> list[tuple[list[Float64], Float64]]:
        """The true solids of the crops of `validation_batch`, in the world of their cameras.

        Returns:
            Of each the planes (K, 4) of its convex parts, and points (P, 3) on its surface (m).
        """


class ShellLoss(Loss, Protocol):
    """A term of the loss of networks that complete single objects (group `loss`)."""

    def check(self, setup: ShellSetup) -> None:
        """Raises a ConfigError before the work if it doesn't fit."""

    def __call__(self, prediction: ShellPrediction, batch: ObjectShellBatch) -> Tensor:
        """A scalar."""


class ObjectShellModel(Network, Protocol):
    """A network from crops about objects to their shells (group `model`)."""

    latent_size: int
    """Length of the code for what a view leaves open."""

    def draws(self, count: int) -> int:
        """Of how many of `count` crops a training pass draws codes."""

    def forward(
        self, crops: ObjectCrops, generator: torch.Generator | None = None
    ) -> ShellPrediction:
        """Shells of the zero code; with a generator those of two random codes for some crops too.

        Args:
            crops: of N objects.
            generator: of codes, on the CPU; None: none is drawn.
        """

    def __call__(
        self, crops: ObjectCrops, generator: torch.Generator | None = None
    ) -> ShellPrediction:
        """Calls `forward`, as torch does."""

    def sample(self, crops: ObjectCrops, codes: Tensor) -> ShellPrediction:
        """Shells of S N crops, code after code.

        Args:
            crops: of N objects.
            codes: (S, N, latent_size), drawn from N(0, I), but the first: 0, the best guess.
        """
