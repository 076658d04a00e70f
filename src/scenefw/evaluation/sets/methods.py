"""Methods that decompose scenes: trained networks, and references that learn nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch

from scenefw.core.errors import ConfigError
from scenefw.core.object_sets import ObjectSetPrediction
from scenefw.core.settings import NOT_NEGATIVE, PART, PROBABILITY
from scenefw.perception.completion.suppression import chosen_objects

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.object_sets import ObjectSetBatch
    from scenefw.core.protocols import InstanceExtractor, Reconstructor
    from scenefw.core.training_protocols import DrawnSetModel, ObjectSetModel, TrainedOnGrid
    from scenefw.core.types import GridSpec


@dataclass(frozen=True)
class SeenSet:
    """One scene and what may be seen of it.

    Args:
        batch: of one scene, on `grid`.
        tsdf: (1, 1, X, Y, Z) of the complete scene (m).
        partial: of its view.
        grid: the voxel grid.
        draws: of what a method draws.
    """

    batch: ObjectSetBatch
    tsdf: Tensor
    partial: PartialTSDF
    grid: GridSpec
    draws: torch.Generator


@dataclass(frozen=True)
class FoundSet:
    """What a method makes of one scene.

    Args:
        objects: (P, X, Y, Z) bool, those that exist; they may overlap.
        labels: (X, Y, Z) int64, for each voxel its most probable object, 1..P, 0 = none.
        prediction: of a batch of one, where there are logits.
        exists: (N,) bool, which of the predictions are in `objects`, as many as P.
    """

    objects: NDArray[np.bool_]
    labels: NDArray[np.int64]
    prediction: ObjectSetPrediction | None = None
    exists: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))


class Decomposer(Protocol):
    """From one scene, or a view of it, to its objects."""

    @property
    def grid(self) -> GridSpec | None:
        """Of its volumes; None if it takes any."""

    def decompose(self, scene: SeenSet) -> FoundSet:
        """The objects of a scene."""


class NetworkDecomposer:
    """Objects that a trained network predicts.

    Args:
        checkpoint: of the task object_sets.
        device: where the network runs.
        smallest: a prediction of a lower volume above 1/2 is no object (m^3).
        suppress: of predictions that overlap with this IoU or more the surest stays, the one with
            the highest existence score, or without such scores the largest; None: all stay.
        drawn: the latent volume is drawn given the view alone, for networks that have a prior.
        draw: which of the draws, from 0.

    Raises:
        ConfigError: a number is out of range, or the network draws nothing.
    """

    def __init__(
        self,
        checkpoint: TrainedOnGrid[Any],
        device: str = "cpu",
        smallest: float = 3e-5,
        suppress: float | None = None,
        draw: int = 0,
        *,
        drawn: bool = False,
    ) -> None:
        NOT_NEGATIVE.require(smallest=smallest, draw=draw)
        PART.require(suppress=suppress)
        self.device = torch.device(device)
        model = checkpoint.model.to(self.device).eval()
        self.model: ObjectSetModel = model
        self.drawing: DrawnSetModel | None = model if drawn else None
        if drawn and not self.model.latent_shape:
            raise ConfigError(
                "this network has no prior to draw from; leave the method out "
                "(~evaluation.methods.drawn), or give the checkpoint of a model=set_placed_vae"
            )
        self.grid, self.metadata = checkpoint.grid, dict(checkpoint.metadata)
        self.smallest, self.suppress = smallest, suppress
        self.draw = draw

    @torch.no_grad()
    def decompose(self, scene: SeenSet) -> FoundSet:
        """The objects of one scene."""
        prediction = self._predict(scene)
        selection = chosen_objects(prediction, 0, self.grid, self.smallest, self.suppress)
        return FoundSet(
            selection.inside[selection.exists], selection.labels, prediction, selection.exists
        )

    def _predict(self, scene: SeenSet) -> ObjectSetPrediction:
        if self.drawing is None:
            return self.model(scene.batch)
        latents = torch.randn((self.draw + 1, *self.drawing.latent_shape), generator=scene.draws)
        return self.drawing.sample(scene.batch.condition, latents[-1:].to(self.device))


class Components:
    """Connected parts of the true occupancy, which learn nothing.

    It sees what an autoencoder of complete scenes sees. Objects that touch are joined.

    Args:
        extractor: of instances of a shape without votes.
    """

    grid = None  # it takes any

    def __init__(self, extractor: InstanceExtractor) -> None:
        self.extractor = extractor

    def decompose(self, scene: SeenSet) -> FoundSet:
        """The parts of one scene."""
        tsdf = (0.5 - scene.batch.occupancy[0, 0]) * scene.grid.voxel_size
        votes = torch.zeros(3, *tsdf.shape, device=tsdf.device)
        return of_instances(self.extractor.extract(tsdf, votes, scene.grid)[0])


class ReconstructedSet:
    """Instances of a reconstructor of complete scenes from one view.

    Args:
        reconstructor: e.g. fitted_hulls, which learns nothing, or the network of chapter 5.
    """

    def __init__(self, reconstructor: Reconstructor) -> None:
        self.reconstructor = reconstructor

    @property
    def grid(self) -> GridSpec | None:
        """The reconstructor's."""
        return self.reconstructor.grid

    def decompose(self, scene: SeenSet) -> FoundSet:
        """Its most typical scene."""
        completions = self.reconstructor.complete(scene.partial, scene.grid, 1, scene.draws)
        return of_instances(completions[0].instances[0])


class Nothing:
    """No object at all, each voxel with the same small probability: the trivial value of measures.

    Args:
        share: of voxels that one prediction occupies on average.
        slots: predictions.

    Raises:
        ConfigError: the share is not within (0, 1).
    """

    grid = None  # it takes any

    def __init__(self, share: float = 0.002, slots: int = 8) -> None:
        PROBABILITY.require(share=share)
        self.logit, self.slots = math.log(share / (1 - share)), slots

    def decompose(self, scene: SeenSet) -> FoundSet:
        """An empty set."""
        size = scene.grid.shape
        logits = torch.full((1, self.slots, *size), self.logit)
        none = torch.zeros(1, self.slots, 0)
        cells = torch.zeros(1, self.slots, dtype=torch.int64)
        prediction = ObjectSetPrediction(logits, none, cells, torch.zeros(1, 0, 1, 1, 1))
        return FoundSet(np.zeros((0, *size), bool), np.zeros(size, np.int64), prediction)


def of_instances(instances: Tensor) -> FoundSet:
    """The set of a labelling (X, Y, Z), 0 = no object."""
    labels = instances.cpu().numpy().astype(np.int64)
    ids = np.unique(labels[labels > 0])
    ranks = np.searchsorted(ids, labels) + 1
    return FoundSet(labels[None] == ids[:, None, None, None], np.where(labels > 0, ranks, 0))
