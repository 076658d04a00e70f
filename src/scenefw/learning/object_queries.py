"""Training of decoders that turn a view into a set of superquadrics."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.queried_sets import (
    ObjectQueryBatch,
    ObjectQueryPrediction,
    ObjectQuerySetup,
    QueriedSet,
)
from scenefw.core.rng import torch_seed
from scenefw.learning.checkpoint import OBJECT_QUERIES
from scenefw.learning.module import TrainingModule
from scenefw.losses.query_distance import distances_of
from scenefw.losses.query_targets import pairs_of
from scenefw.matching.queried_sets import matched_queries, owners_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from torch import Tensor

    from scenefw.core.protocols import Matching
    from scenefw.core.query_protocols import ObjectQueryData, ObjectQueryLoss, ObjectQueryModel
    from scenefw.core.training_protocols import Loss
    from scenefw.learning.optimizers import Optimizer
    from scenefw.learning.schedules import Schedule

_NOISE = 5  # random stream, beside those of data


class ObjectQueryLearning(TrainingModule):
    """Trains a decoder of sets (group `learning`).

    Queries of each layer are matched to true objects once per step, before all losses. Several
    start on one object, and only one of them stands for it. The others learn its shape too, as that
    asks for no agreement; that they don't stand for it is for their existence scores alone.

    Args:
        model: the network.
        losses: terms by name.
        learning_rate: of the optimiser at factor 1.
        weight_decay: of the optimiser; 0 makes AdamW Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: of the noise of denoising queries.
        initial: weights to start from; None: random ones.
        reinitialise: modules of the network that start from random weights even so.
        matching: says which query stands for which object; None: the optimal assignment.
        early: share of the schedule's budget during which early losses count.
        dense: queries that stand for nothing learn the object at whose surface they start.
        channels_last: keep weights of convolutions channels last in memory, which is fast.
        compile: let torch.compile make network and losses faster; a text names a backend.
        optimizer: how gradients change weights; None means AdamW.

    Raises:
        ConfigError: a share outside 0..1, and as of any training.
    """

    task = OBJECT_QUERIES
    model: ObjectQueryModel

    def __init__(
        self,
        model: ObjectQueryModel,
        losses: Mapping[str, ObjectQueryLoss],
        learning_rate: float = 1e-3,
        weight_decay: float = 0.01,
        schedule: Schedule | None = None,
        average: float = 0.998,
        seed: int = 0,
        initial: str | Path | None = None,
        reinitialise: Sequence[str] = (),
        matching: Matching | None = None,
        early: float = 0.3,
        *,
        dense: bool = True,
        channels_last: bool = True,
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        if not 0 <= early <= 1:
            raise ConfigError(
                f"learning.early is {early}, expected a share of the budget from 0 to 1"
            )
        super().__init__(
            model, losses, learning_rate, weight_decay, schedule, average, seed, initial,
            reinitialise, channels_last=channels_last, compile=compile, optimizer=optimizer,
        )  # fmt: skip
        self.matching, self.early, self.dense = matching, early, dense
        self._terms = losses

    def setup_with(self, data: ObjectQueryData) -> ObjectQuerySetup:
        """Grid and number of queries.

        Raises:
            ConfigError: the network sees something else, scenes have more objects than there are
                queries, or the encoder was trained on another grid.
        """
        if data.sees != self.model.sees:
            raise ConfigError(
                f"the network sees views as {self.model.sees}s, the data are {data.sees}s; give "
                "model=object_queries with dataset=object_queries, or model=image_queries with "
                "dataset=image_queries"
            )
        if data.most > self.model.queries:
            raise ConfigError(
                f"the network has {self.model.queries} queries, the data have up to {data.most} "
                "objects in a scene; give more by model.seeded or model.free"
            )
        if self.model.grid is not None and data.grid != self.model.grid:
            raise ConfigError(
                f"the encoder of model.encoder was trained on {self.model.grid}, the data have "
                f"{data.grid}; give grid.resolution={self.model.grid.resolution}, or another "
                "encoder by model.encoder.path=FILE"
            )
        return ObjectQuerySetup(data.grid, self.model.queries)

    def losses_now(self) -> Mapping[str, Loss]:
        """Leaves out early losses after the first part of the budget."""
        if self.budget_done < self.early:
            return self.losses
        return {name: loss for name, loss in self._terms.items() if not loss.early}

    def predict_batch(self, batch: ObjectQueryBatch) -> ObjectQueryPrediction:
        """The training pass with the noise of this step, each layer matched to true objects."""
        draws = torch.Generator()  # on the CPU: the same on every device
        draws.manual_seed(torch_seed(self.seed, _NOISE, self.batches_seen, self.global_rank))
        return matched(self.model(batch, draws), batch, self.matching, dense=self.dense)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """All losses and figures of the last layer, of the same views every time."""
        validation_batch = self.validation_batch(batch)
        prediction = matched(self.model(validation_batch), validation_batch, self.matching)
        terms = {
            f"val/{name}": loss(prediction, validation_batch) for name, loss in self.losses.items()
        }
        values = {**terms, **figures(prediction.layers[-1], validation_batch)}
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)


def matched(
    prediction: ObjectQueryPrediction,
    batch: ObjectQueryBatch,
    matching: Matching | None = None,
    *,
    dense: bool = False,
) -> ObjectQueryPrediction:
    """The prediction with the true object that each query of each layer stands for.

    Args:
        prediction: of all layers.
        batch: with the true objects.
        matching: says which query stands for which object; None: the optimal assignment.
        dense: also look for the object at whose surface each query starts.
    """
    owned = owners_of(prediction.layers[0], batch) if dense else None
    layers = [
        replace(queried_set, matched=matched_queries(queried_set, batch, matching), owned=owned)
        for queried_set in prediction.layers
    ]
    return ObjectQueryPrediction(layers, prediction.denoised)


@torch.no_grad()
def figures(queried_set: QueriedSet, batch: ObjectQueryBatch) -> dict[str, Tensor]:
    """Scores of matched predictions.

    val/overlap: mean over objects of the IoU with the query that stands for it, at places in a box
    about it, 0 where that says it doesn't exist. val/count_error: how many objects a scene has too
    many or too few. val/centre_error: of those that stand for an object (m).
    """
    exists = queried_set.active & (queried_set.existence > 0)
    views, queries, objects = pairs_of(queried_set)
    half = batch.places.shape[2] // 2
    places, true = batch.places[views, objects, half:], batch.distances[views, objects, half:] < 0
    mine = distances_of(queried_set, views, queries, places) < 0
    overlap = (mine & true).sum(dim=1) / (mine | true).sum(dim=1).clamp_min(1)
    matched_exists = exists[views, queries]
    gaps = queried_set.positions[views, queries] - batch.scenes.positions[views, objects]
    count = batch.scenes.present.sum(dim=1)
    return {
        "val/overlap": (overlap * matched_exists).sum() / count.sum().clamp_min(1),
        "val/count_error": (exists.sum(dim=1) - count).abs().float().mean(),
        "val/centre_error": torch.linalg.vector_norm(gaps, dim=-1).sum() / max(len(gaps), 1),
    }
