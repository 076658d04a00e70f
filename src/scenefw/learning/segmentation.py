"""Training of labelling networks on views or on crops of height maps."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from scenefw.core.batches import SegmentationBatch
from scenefw.core.errors import ConfigError
from scenefw.core.rng import torch_seed
from scenefw.data.modules import IndexBatch
from scenefw.data.segmentation import SegmentationData
from scenefw.learning.checkpoint import SEGMENTATION
from scenefw.learning.initial import start_from
from scenefw.learning.module import TrainingModule
from scenefw.learning.optimizers import Optimizer
from scenefw.learning.provenance import origin
from scenefw.learning.schedules import ExponentialDecay, Schedule
from scenefw.metrics.semantic import class_ious, count_classes, mean_iou, weighted_iou

_DROPOUT = 8  # random stream


class SegmentationLearning(TrainingModule):
    """Trains a network from colour and distance to a label per pixel (group `learning`).

    Which samples come next, what is done to them and which features are dropped are functions of
    the seed and of the number of batches seen, so that a resumed training goes on as if never
    stopped.

    Args:
        model: the network, with as many `classes` as the data.
        losses: terms by name, each with a `weight`.
        learning_rate: of the optimiser at factor 1.
        weight_decay: of the optimiser; 0 makes AdamW Adam.
        schedule: factor of the learning rate; None means x0.96 every 1e5 steps (thesis 4.7.1).
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: seed of dropout.
        initial: checkpoint whose weights to start from; None starts from random ones.
        reinitialise: modules of the network, such as body.decoder.3, that start from random
            weights even so, also where the checkpoint has none: the levels by which a network is
            deeper.
        channels_last: memory format of the network, faster on CPUs and on tensor cores.
        compile: let torch.compile make the network's training pass faster; a text names a backend.
        optimizer: how gradients change weights; None means AdamW.
    """

    task = SEGMENTATION

    def __init__(
        self,
        model: nn.Module,
        losses: Mapping[str, Callable[[Tensor, SegmentationBatch], Tensor]],
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
        if initial is not None:
            start_from(model, initial, SEGMENTATION, list(reinitialise))
        model = model.to(memory_format=torch.channels_last) if channels_last else model
        schedule = schedule or ExponentialDecay()
        super().__init__(
            model, learning_rate, weight_decay, schedule, average, seed, compile, optimizer
        )
        if not losses:
            raise ConfigError("no loss to train labels with; give loss=[cross_entropy]")
        self.started_from = origin(initial) if initial is not None else None
        self.losses: dict[str, Any] = dict(losses)

    def facts(self) -> dict[str, Any]:
        """How it trains."""
        return {
            "optimizer": str(self.optimizer),
            "learning_rate": self.learning_rate,
            "losses": {name: loss.weight for name, loss in self.losses.items()},
            "seed": self.seed,
        }

    def check(self, data: SegmentationData) -> None:
        """Finds out before the work whether network, losses and data go together.

        Raises:
            ConfigError: they have another number of classes.
        """
        classes = data.classes
        if len(classes) != self.model.classes:
            raise ConfigError(
                f"the network has {self.model.classes} classes and the data {len(classes)} "
                f"({', '.join(classes)}); give model.classes={len(classes)}"
            )
        for loss in self.losses.values():
            if hasattr(loss, "check"):
                loss.check(len(classes))

    def training_step(self, batch: IndexBatch, batch_idx: int) -> Tensor:
        """The weighted sum of the losses of the next batch, found by the number of batches seen."""
        batch = self.trainer.train_dataloader.batch(self.batches_seen)
        data = self.trainer.datamodule
        images = self.fetch(lambda: data.training_batch(batch, self.device))
        # Dropout draws from torch's global generator and from no other: it is lent and given back.
        devices = [self.device] if self.device.type == "cuda" else []
        with torch.random.fork_rng(devices):
            torch.manual_seed(torch_seed(self.seed, _DROPOUT, self.batches_seen, self.global_rank))
            scores = self.model(images.colour, images.distance)
        terms = {name: loss(scores, images) for name, loss in self.losses.items()}
        total: Tensor = sum(self.losses[name].weight * term for name, term in terms.items())
        values = {f"train/{name}": term.detach() for name, term in terms.items()}
        self.log_dict({"train/total": total.detach(), **values}, batch_size=len(batch.indices))
        self.count_batch()
        return total

    def on_validation_epoch_start(self) -> None:
        """Counts anew."""
        super().on_validation_epoch_start()
        self._counts = np.zeros((self.model.classes, self.model.classes + 1), np.int64)

    def validation_step(self, batch: IndexBatch, batch_idx: int) -> None:
        """Counts predicted labels of the same samples every time."""
        images = self.trainer.datamodule.validation_batch(batch, self.device)
        predicted = self.model(images.colour, images.distance).argmax(dim=1)
        self._counts += count_classes(
            predicted.cpu().numpy(), images.labels.cpu().numpy(), self.model.classes
        )

    def on_validation_epoch_end(self) -> None:
        """Logs the IoU of the whole validation set, and of each class that it holds."""
        super().on_validation_epoch_end()
        if self.trainer.world_size > 1:
            every = self.all_gather(torch.from_numpy(self._counts).to(self.device))
            self._counts = every.sum(dim=0).cpu().numpy()
        values = {"miou": mean_iou(self._counts), "weighted_iou": weighted_iou(self._counts)}
        names = self.trainer.datamodule.classes
        values |= dict(zip(names, class_ious(self._counts), strict=True))
        # float32: Lightning keeps no doubles on some devices
        self.log_dict({f"val/{n}": np.float32(v) for n, v in values.items() if np.isfinite(v)})
