"""What every training has: optimiser, schedule, averaged weights, and state to go on from."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

import lightning
import torch
from torch import Tensor, nn

from scenefw.core.types import GridSpec
from scenefw.learning.averaging import AveragedWeights
from scenefw.learning.costs import Batch, SideStream, StepTimes, peak_memory
from scenefw.learning.optimizers import RATE, AdamW, Optimizer
from scenefw.learning.schedules import Progress, Schedule, StepDecay

AGREE_EVERY = 10
"""Steps between looks at the first process's clock, each of which waits for the device."""

_WARM_UP = 2  # steps of a call that don't count for its rate: kernels are compiled in them


class TrainingModule(lightning.LightningModule, ABC):
    """A training that goes on after a kill as if never stopped; a subclass says what a step is.

    A step must depend on the weights, on `batches_seen` and on a seed alone. It gets its data by
    `fetch`, calls `self.model`, and ends with `count_batch`.

    Args:
        model: the network, with a `recipe` that rebuilds it.
        learning_rate: of the optimiser at factor 1.
        weight_decay: of the optimiser; 0 makes AdamW Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        seed: of all randomness.
        compile: let torch.compile make the network's training pass faster; a text names a backend.
        optimizer: how gradients change weights; None means AdamW.
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
        compile: bool | str = False,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None = None,
    ) -> None:
        super().__init__()
        self.model = model
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.schedule, self.optimizer = schedule or StepDecay(), optimizer or AdamW()
        self.seed, self.compiled = seed, compile
        self.average = AveragedWeights(model, average) if average else None
        self.started_from: Mapping[str, Any] | None = None  # metadata of the initial weights
        self.batches_seen, self.seconds, self.batches_per_epoch = 0, 0.0, 0
        self.samples_seen = 0
        self.describe: Callable[[], Mapping[str, Any]] = dict
        """Says how and on what it trains, for the state and for those who go on from it."""
        self.times, self._side = StepTimes(), SideStream()
        self._began, self._agreed = time.monotonic(), 0.0
        self._since, self._warm = (0, 0.0), 0
        self._trained_on: torch.device | None = None  # Lightning leaves the network on the CPU

    @abstractmethod
    def training_step(self, batch: Any, batch_idx: int) -> Tensor:
        """The loss of the next batch."""

    @abstractmethod
    def facts(self) -> Mapping[str, Any]:
        """How it trains, as plain data for the checkpoint's metadata."""

    def check(self, data: Any) -> None:
        """Finds out before the work whether network, losses and data go together.

        Raises:
            ConfigError: they don't.
        """

    @property
    def grid(self) -> GridSpec | None:
        """The voxel grid of the network, if it has one."""
        return None

    def configure_optimizers(self) -> torch.optim.Optimizer:
        """The optimiser, its step in one kernel where that is possible."""
        # 16-bit floats need gradients scaled back before they are clipped; the fused step is late.
        fused = self.device.type in ("cpu", "cuda") and self.trainer.precision != "16-mixed"
        return self.optimizer.make(self.model, self.learning_rate, self.weight_decay, fused=fused)

    def configure_gradient_clipping(
        self,
        optimizer: torch.optim.Optimizer,
        gradient_clip_val: float | None = None,
        gradient_clip_algorithm: str | None = None,
    ) -> None:
        """Bounds the norm; Lightning's own way refuses fused optimisers."""
        if gradient_clip_val:
            nn.utils.clip_grad_norm_(self.model.parameters(), gradient_clip_val)

    def on_fit_start(self) -> None:
        """Brings the averaged weights to the training device; compiles the training pass."""
        self._trained_on = self.device
        if self.average is not None:
            self.average.to(self.device)
        if self.compiled:  # the call alone: names of weights and the recipe stay as they are
            backend = self.compiled if isinstance(self.compiled, str) else "inductor"
            self.model.compile(backend=backend)

    def on_train_start(self) -> None:
        """Starts the clock."""
        self.batches_per_epoch = len(self.trainer.train_dataloader)
        self._since = (self.batches_seen, self.seconds)
        self._warm = self.batches_seen + _WARM_UP
        self._agreed = self._common(self.seconds)
        self._began = time.monotonic()

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Sets the learning rate of this step."""
        self._count_time()
        if self.batches_seen == self._warm:
            self._since = (self.batches_seen, self.seconds)
        epoch, position = divmod(self.batches_seen, self.batches_per_epoch)
        if self.trainer.world_size == 1:
            self._agreed = self.seconds
        elif self.batches_seen % AGREE_EVERY == 0:  # one clock, else learning rates drift apart
            self._agreed = self._common(self.seconds)
        progress = Progress(
            self.batches_seen, epoch, self._agreed, position / self.batches_per_epoch
        )
        rate = self.learning_rate * self.schedule.factor(progress)
        for group in self.optimizers().param_groups:  # type: ignore[union-attr]
            group["lr"] = rate * group.get(RATE, 1.0)
        self.budget_done = self.schedule.done(progress)
        self.times.begin(self.device)

    def count_batch(self) -> None:
        """Notes that one more batch went through the network."""
        self.batches_seen += 1
        self.samples_seen += self.trainer.datamodule.batch_size * self.trainer.world_size
        self._count_time()

    def optimizer_step(self, *arguments: Any, **options: Any) -> None:
        """Steps, then averages the weights, before callbacks see the end of the batch."""
        super().optimizer_step(*arguments, **options)
        if self.average is not None:
            self.average.update(self.model)
        self.times.end(self.device)
        self._count_time()

    def fetch(self, make: Callable[[], Batch]) -> Batch:
        """The data of a step, made beside the network where the device can do that."""
        batch = self._side.run(self.device, make)
        self.times.drawn(self.device)
        return batch

    def costs(self) -> dict[str, float]:
        """Samples per second, peak memory (MB) and the share of time spent waiting for data."""
        batches, seconds = self.batches_seen - self._since[0], self.seconds - self._since[1]
        samples = batches * self.trainer.datamodule.batch_size * self.trainer.world_size
        return {
            "samples_per_second": samples / max(seconds, 1e-9),
            "memory_mb": peak_memory(self._trained_on or self.device) / 1e6,
            "share_of_data": self.times.share_of_data,
        }

    @contextmanager
    def clock_stopped(self) -> Iterator[None]:
        """What happens meanwhile is no training."""
        self._count_time()
        yield
        self._began = time.monotonic()

    def _count_time(self) -> None:
        now = time.monotonic()
        self.seconds += now - self._began
        self._began = now

    def _common(self, seconds: float) -> float:
        several = self.trainer.world_size > 1
        return self.trainer.strategy.broadcast(seconds) if several else seconds

    def on_validation_start(self) -> None:
        """Stops the clock."""
        self._count_time()

    def on_validation_end(self) -> None:
        """The clock goes on."""
        self._began = time.monotonic()

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
            "samples_seen": self.samples_seen,
            "facts": dict(self.describe()),
            "seconds": self.seconds,
            "batches_per_epoch": self.batches_per_epoch,
            "average": self.average.state_dict() if self.average is not None else None,
            "started_from": self.started_from,
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Goes on from there."""
        state = checkpoint["scenefw"]
        self.batches_seen, self.seconds = state["batches_seen"], state["seconds"]
        self.batches_per_epoch = state["batches_per_epoch"]
        self.samples_seen = state["samples_seen"]
        self.started_from = state.get("started_from", self.started_from)
        if self.average is not None and state["average"] is not None:
            self.average.load_state_dict(state["average"])
