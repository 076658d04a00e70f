"""What every training has: optimiser, schedule, averaged weights, and state to go on from."""

import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

import lightning
import torch
from torch import Tensor, nn

from scenefw.core.types import GridSpec
from scenefw.learning.averaging import AveragedWeights
from scenefw.learning.schedules import Progress, Schedule, StepDecay


class TrainingModule(lightning.LightningModule, ABC):
    """A training that goes on after a kill as if never stopped; a subclass says what a step is.

    A step must depend on the weights, on `batches_seen` and on a seed alone; then its end counts
    with `count_batch`.

    Args:
        model: the network, with a `recipe` that rebuilds it.
        learning_rate: of AdamW at factor 1.
        weight_decay: of AdamW; 0 makes it Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: of all randomness.
    """

    task: str
    """What the network is for, as checkpoints name it."""

    def __init__(
        self,
        model: nn.Module,
        learning_rate: float,
        weight_decay: float,
        schedule: Schedule | None,
        average: float,
        seed: int,
    ) -> None:
        super().__init__()
        self.model = model
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.schedule = schedule or StepDecay()
        self.seed = seed
        self.average = AveragedWeights(model, average) if average else None
        self.batches_seen, self.seconds = 0, 0.0
        self._began = time.monotonic()

    @abstractmethod
    def training_step(self, batch: Any, batch_idx: int) -> Tensor:
        """The loss of the next batch."""

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """How it trains, as plain data for the checkpoint's metadata."""

    @property
    def grid(self) -> GridSpec | None:
        """The voxel grid of the network, if it has one."""
        return None

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """AdamW, which is Adam where `weight_decay` is 0."""
        return torch.optim.AdamW(
            self.model.parameters(), lr=self.learning_rate, weight_decay=self.weight_decay
        )

    def on_fit_start(self) -> None:
        """Brings the averaged weights to the training device."""
        if self.average is not None:
            self.average.to(self.device)

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Sets the learning rate of this step."""
        self._began = time.monotonic()
        epoch = self.batches_seen // len(self.trainer.train_dataloader)
        if self.trainer.world_size > 1:  # one clock, else learning rates drift apart
            self.seconds = self.trainer.strategy.broadcast(self.seconds)
        progress = Progress(self.batches_seen, epoch, self.seconds)
        for group in self.optimizers().param_groups:  # type: ignore[union-attr]
            group["lr"] = self.learning_rate * self.schedule.factor(progress)

    def count_batch(self) -> None:
        """Notes that one more batch went through the network."""
        self.batches_seen += 1
        self._count_time()

    def optimizer_step(self, *arguments: Any, **options: Any) -> None:
        """Steps, then averages the weights, before callbacks see the end of the batch."""
        super().optimizer_step(*arguments, **options)
        if self.average is not None:
            self.average.update(self.model)
        self._count_time()

    def _count_time(self) -> None:
        now = time.monotonic()
        self.seconds += now - self._began
        self._began = now

    def on_validation_epoch_start(self) -> None:
        """Validates the averaged weights."""
        self._swap = self.averaged()
        self._swap.__enter__()

    def on_validation_epoch_end(self) -> None:
        """Goes back to the weights that are trained."""
        self._swap.__exit__(None, None, None)

    @contextmanager
    def averaged(self) -> Iterator[None]:
        """The network holds the averaged weights meanwhile."""
        with self.average.swapped(self.model) if self.average is not None else nullcontext():
            yield

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Keeps where the training is."""
        checkpoint["scenefw"] = {
            "recipe": self.model.recipe,
            "batches_seen": self.batches_seen,
            "seconds": self.seconds,
            "average": self.average.state_dict() if self.average is not None else None,
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Goes on from there."""
        state = checkpoint["scenefw"]
        self.batches_seen, self.seconds = state["batches_seen"], state["seconds"]
        if self.average is not None and state["average"] is not None:
            self.average.load_state_dict(state["average"])
