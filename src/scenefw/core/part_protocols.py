"""Protocols of networks that cut images into parts: data, losses, networks and their weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from scenefw.core.training_protocols import Loss, Network, TrainingData

if TYPE_CHECKING:
    import torch
    from torch import Tensor
    from torch.nn import Module

    from scenefw.core.batches import CameraBatch, IndexBatch
    from scenefw.core.part_views import PartViewBatch, PartViewSetup


class PartViewData(TrainingData, Protocol):
    """Depth images and which object each pixel shows (group `dataset`, option `part_views`)."""

    image_size: tuple[int, int]
    """Width and height (pixels)."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """Images of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> PartViewBatch:
        """The same images in every epoch."""


class PartAffinityLoss(Loss, Protocol):
    """A term of the loss of networks that cut images into parts (group `loss`)."""

    teaches_shown: bool
    """Whether it teaches which pixels show objects: a network that says so needs one such loss."""

    def check(self, setup: PartViewSetup) -> None:
        """Raises a ConfigError before the work if it doesn't fit these images."""

    def __call__(self, prediction: Tensor, batch: PartViewBatch) -> Tensor:
        """A scalar from logits (B, 2 to 4, H, W)."""


class PartAffinityModel(Network, Protocol):
    """A network that says which neighbouring pixels of a depth image show one object."""

    focal: float
    """Focal length (pixels) of the images that it learnt from."""
    shown: Module | None
    """Says which pixels show objects; None: it doesn't."""
    obstacles: Module | None
    """Says which pixels show obstacles; None: it doesn't."""

    def forward(self, depth: Tensor, cameras: CameraBatch, colour: Tensor | None = None) -> Tensor:
        """Logits (B, 2, H, W) for the neighbour on the right and the one below.

        A third says whether the pixel shows an object, if `shown` isn't None; a fourth whether it
        shows an obstacle, if `obstacles` isn't.

        Args:
            depth: (B, H, W) z-depth in metres, 0 = no measurement.
            cameras: one per image, the floor at z = 0.
            colour: (B, 3, H, W) from 0 to 1, NaN in images without; None: no image has any.
        """

    def __call__(self, depth: Tensor, cameras: CameraBatch, colour: Tensor | None = None) -> Tensor:
        """Calls `forward`, as torch does."""
