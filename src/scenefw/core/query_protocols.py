"""Protocols of decoders of sets: data, losses, networks and their weights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from scenefw.core.training_protocols import Loss, Network, TrainingData

if TYPE_CHECKING:
    import torch
    from torch import Tensor

    from scenefw.core.batches import IndexBatch
    from scenefw.core.queried_sets import (
        ObjectQueryBatch,
        ObjectQueryPrediction,
        ObjectQuerySetup,
        QueriedSet,
    )
    from scenefw.core.types import GridSpec


class ObjectQueryData(TrainingData, Protocol):
    """Views, seen points, and objects (group `dataset`, `object_queries` and `image_queries`)."""

    grid: GridSpec
    sees: str
    """What networks are shown: `VOLUME` or `IMAGE` of `core.queried_sets`."""
    most: int
    """The largest number of objects in a scene."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """Views and objects of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectQueryBatch:
        """The same views in every epoch."""


class ObjectQueryLoss(Loss, Protocol):
    """A term of the loss of decoders of sets (group `loss`, options `query_*`)."""

    early: bool
    """Whether it counts in the first part of a training alone (`learning.early`)."""

    def check(self, setup: ObjectQuerySetup) -> None:
        """Raises a ConfigError before the work if it doesn't fit these sets."""

    def __call__(self, prediction: ObjectQueryPrediction, batch: ObjectQueryBatch) -> Tensor:
        """A scalar from all sets of `prediction.taught`, matched to objects."""


class ObjectQueryModel(Network, Protocol):
    """A network from a partial view to a set of superquadrics (`model=object_queries`)."""

    grid: GridSpec | None
    """Of the views that it sees; None: it sees images, and any will do."""
    sees: str
    """What its encoder sees: `VOLUME` or `IMAGE` of `core.queried_sets`."""
    queries: int
    """Objects that it predicts, most of which don't exist."""

    def forward(
        self, batch: ObjectQueryBatch, generator: torch.Generator | None = None
    ) -> ObjectQueryPrediction:
        """Training pass; without a generator nothing is random."""

    def __call__(
        self, batch: ObjectQueryBatch, generator: torch.Generator | None = None
    ) -> ObjectQueryPrediction:
        """Calls `forward`, as torch does."""

    def predict(self, condition: Tensor, points: Tensor, seen: Tensor) -> QueriedSet:
        """The set of the last layer, of what a `ObjectQueryBatch` says of views."""
