"""Training of labelling networks on views or on crops of height maps."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import IndexBatch, SegmentationBatch, SegmentationSetup
from scenefw.core.errors import ConfigError
from scenefw.core.rng import torch_seed
from scenefw.core.training_protocols import (
    SegmentationLoss,
    SegmentationModel,
    SegmentationTrainingData,
)
from scenefw.learning.checkpoint import SEGMENTATION
from scenefw.learning.module import TrainingModule
from scenefw.learning.optimizers import Optimizer
from scenefw.learning.schedules import ExponentialDecay, Schedule
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou, weighted_iou

_DROPOUT = 8  # random stream


class SegmentationLearning(TrainingModule):
    """Trains a network from colour and distance to a label per pixel (group `learning`).

    Further arguments are those of any training.

    Args:
        model: the network, with as many `classes` as the data.
        schedule: factor of the learning rate; None means x0.96 every 1e5 steps (thesis 4.7.1).
        reinitialise: modules of the network, such as body.decoder.3, that start from random weights
            even so, also where the checkpoint has none: the levels by which a network is deeper.
    """

    task = SEGMENTATION
    model: SegmentationModel

    def __init__(
        self,
        model: SegmentationModel,
        losses: Mapping[str, SegmentationLoss],
        learning_rate: float = 1e-3,
        weight_decay: float = 0.0,
        schedule: Schedule | None = None,
        average: float = 0.998,
        seed: int = 0,
        initial: str | Path | None = None,
        reinitialise: Sequence[str] = (),
        *,
        channels_last: bool = True,
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        super().__init__(
            model, losses, learning_rate, weight_decay, schedule or ExponentialDecay(), average,
            seed, initial, reinitialise,
            channels_last=channels_last, compile=compile, optimizer=optimizer,
        )  # fmt: skip

    def setup_with(self, data: SegmentationTrainingData) -> SegmentationSetup:
        """The classes.

        Raises:
            ConfigError: network and data have another number of them.
        """
        classes = data.classes
        if len(classes) != self.model.classes:
            raise ConfigError(
                f"the network has {self.model.classes} classes and the data {len(classes)} "
                f"({', '.join(classes)}); give model.classes={len(classes)}"
            )
        return SegmentationSetup(classes)

    def predict_batch(self, batch: SegmentationBatch) -> Tensor:
        """Scores (B, classes, H, W), with the dropout of this step."""
        # Dropout only draws from torch's global generator: its state is set, then restored.
        devices = [self.device] if self.device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            torch.manual_seed(torch_seed(self.seed, _DROPOUT, self.batches_seen, self.global_rank))
            return self.model(batch.colour, batch.distance)

    def on_validation_epoch_start(self) -> None:
        """Resets the counts."""
        super().on_validation_epoch_start()
        self._counts = np.zeros((self.model.classes, self.model.classes + 1), np.int64)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Counts predicted labels; the samples are the same every time."""
        images = self.validation_batch(batch)
        predicted = self.model(images.colour, images.distance).argmax(dim=1)
        self._counts += count_classes(
            predicted.cpu().numpy(), images.labels.cpu().numpy(), self.model.classes
        )

    def on_validation_epoch_end(self) -> None:
        """Logs the IoU of the whole validation set, and of each class that it holds."""
        super().on_validation_epoch_end()
        if self.trainer.world_size > 1:
            gathered_counts = self.all_gather(torch.from_numpy(self._counts).to(self.device))
            self._counts = gathered_counts.sum(dim=0).cpu().numpy()
        values = {"miou": mean_iou(self._counts), "weighted_iou": weighted_iou(self._counts)}
        names = self.trainer.datamodule.classes
        values |= dict(zip(names, class_ious(self._counts), strict=True))
        # float32: Lightning keeps no doubles on some devices
        self.log_dict({f"val/{n}": np.float32(v) for n, v in values.items() if np.isfinite(v)})
