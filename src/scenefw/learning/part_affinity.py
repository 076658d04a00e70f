"""Training of networks that cut depth images into parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import torch
from torch import Tensor

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.part_views import PartViewBatch, PartViewSetup
from scenefw.learning.checkpoint import PART_AFFINITY
from scenefw.learning.module import TrainingModule
from scenefw.losses.part_affinity import true_affinities

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.part_protocols import PartAffinityLoss, PartAffinityModel, PartViewData


class PartAffinityLearning(TrainingModule):
    """Trains a network of affinities (group `learning`); arguments are those of any training."""

    task = PART_AFFINITY
    model: PartAffinityModel

    def setup_with(self, data: PartViewData) -> PartViewSetup:
        """The size of the images, and what the network says.

        Raises:
            ConfigError: the network says which pixels show objects, and no loss teaches it that.
        """
        predicts_shown = self.model.shown is not None
        losses = cast("Mapping[str, PartAffinityLoss]", self.losses)
        taught = any(loss.teaches_shown for loss in losses.values())
        if predicts_shown and not taught:
            raise ConfigError(
                "no loss teaches the network which pixels show objects; add 'loss=[part_affinity,"
                "part_shown]', or give model.shown=false"
            )
        return PartViewSetup(*data.image_size, shown=predicts_shown)

    def predict_batch(self, batch: PartViewBatch) -> Tensor:
        """Logits (B, 2 to 4, H, W)."""
        return self.model(batch.depth, batch.cameras, batch.colour)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Losses, and shares of borders and of insides that are told right, on the same images."""
        validation_batch = self.validation_batch(batch)
        prediction = self.predict_batch(validation_batch)
        values = {
            f"val/{name}": float(loss(prediction, validation_batch))
            for name, loss in self.losses.items()
        }
        same_object, counts = true_affinities(validation_batch.owners)
        values["val/affinity_accuracy"] = _balanced_accuracy(prediction[:, :2], same_object, counts)
        if prediction.shape[1] > 3 and validation_batch.obstacles is not None:
            valid = validation_batch.depth > 0
            values["val/obstacle_accuracy"] = _balanced_accuracy(
                prediction[:, 3], validation_batch.obstacles, valid
            )
        self.log_dict(values, batch_size=len(batch.indices), on_epoch=True, sync_dist=True)


def _balanced_accuracy(logits: Tensor, target: Tensor, counts: Tensor) -> float:
    """Mean of the shares of positives and of negatives that are told right, of 0..1."""
    right = (logits > 0) == target
    groups = (counts & target, counts & ~target)
    return float(torch.stack([right[g].float().mean() for g in groups if g.any()]).mean())
