"""All of a training but its steps: optimiser, schedule, averaged weights, clock and state."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from typing import Any

import lightning
import torch
from torch import nn

from scenefw.core.settings import NOT_NEGATIVE, POSITIVE, below
from scenefw.learning import renamed
from scenefw.learning.averaging import AveragedWeights
from scenefw.learning.clock import Clock
from scenefw.learning.costs import StepTimes, peak_memory
from scenefw.learning.optimizers import RATE, AdamW, Optimizer
from scenefw.learning.schedules import Progress, Schedule, StepDecay

AGREE_EVERY = 10
"""Steps between reads of the first process's clock; each read waits for the device."""


class ResumableModule(lightning.LightningModule):
    """Keeps the progress of a training, so that it resumes after a kill as if never stopped.

    Args:
        model: the network.
        learning_rate: of the optimiser at factor 1.
        weight_decay: of the optimiser; 0 makes AdamW Adam.
        schedule: factor of the learning rate; None means 0.99 every 5 epochs.
        average: decay of the moving average of weights that is validated and exported; 0: none.
        compile: let torch.compile make network and losses faster; a text names a backend.
        optimizer: how gradients change weights; None means AdamW.

    Raises:
        ConfigError: a number out of range.
    """

    budget_done: float = 1.0
    """Share of the schedule's budget that is used up at this step."""

    def __init__(
        self,
        model: nn.Module,
        learning_rate: float,
        weight_decay: float,
        schedule: Schedule | None,
        average: float,
        compile: bool | str,  # noqa: A002 - as torch calls it
        optimizer: Optimizer | None,
    ) -> None:
        POSITIVE.require(learning_rate=learning_rate)
        NOT_NEGATIVE.require(weight_decay=weight_decay)
        below(1).require(average=average)
        super().__init__()
        self.model = model
        self.learning_rate, self.weight_decay = learning_rate, weight_decay
        self.schedule, self.optimizer = schedule or StepDecay(), optimizer or AdamW()
        self.compiled = compile
        self.average = AveragedWeights(model, average) if average else None
        self.started_from: Mapping[str, Any] | None = None
        """Metadata of the initial weights."""
        self.batches_seen, self.samples_seen, self.batches_per_epoch = 0, 0, 0
        self.may_change: Collection[str] = ()
        """Facts of the training in which a state that it resumes from may differ."""
        self.describe: Callable[[], Mapping[str, Any]] = dict
        """Says how and on what it trains, for the state and for those who resume it."""
        self.clock, self.times = Clock(), StepTimes()
        self._common_seconds = 0.0
        self._trained_on: torch.device | None = None  # Lightning leaves the network on the CPU

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
        if self.compiled:  # only the call: names of weights and the recipe stay the same
            self.model.compile(backend=self.backend)

    def on_train_start(self) -> None:
        """Starts the clock."""
        self.batches_per_epoch = len(self.trainer.train_dataloader)
        self._common_seconds = self._common(self.seconds)
        self.clock.start(self.batches_seen)

    def on_train_batch_start(self, batch: Any, batch_idx: int) -> None:
        """Sets the learning rate of this step."""
        self.clock.next_step(self.batches_seen)
        progress = self._progress()
        rate = self.learning_rate * self.schedule.factor(progress)
        for group in self.optimizers().param_groups:  # type: ignore[union-attr]
            group["lr"] = rate * group.get(RATE, 1.0)
        self.budget_done = self.schedule.budget_share(progress)
        self.times.begin(self.device)

    @property
    def backend(self) -> str:
        """What torch.compile compiles with."""
        return self.compiled if isinstance(self.compiled, str) else "inductor"

    @property
    def batch_number(self) -> int:
        """How many batches of today's size it has seen; an earlier leg may have had others."""
        return self.samples_seen // self._samples_per_batch

    @property
    def epochs_seen(self) -> float:
        """Passes over the training data."""
        return self.batch_number / max(self.batches_per_epoch, 1)

    @property
    def _samples_per_batch(self) -> int:
        return int(self.trainer.datamodule.batch_size * self.trainer.world_size)

    def _progress(self) -> Progress:
        epoch, position = divmod(self.batch_number, self.batches_per_epoch)
        if self.trainer.world_size == 1:
            self._common_seconds = self.seconds
        elif self.batches_seen % AGREE_EVERY == 0:  # one clock, else learning rates drift apart
            self._common_seconds = self._common(self.seconds)
        share = position / self.batches_per_epoch
        return Progress(self.batches_seen, epoch, self._common_seconds, share)

    def count_batch(self) -> None:
        """Counts one more batch."""
        self.batches_seen += 1
        self.samples_seen += self._samples_per_batch
        self.clock.count()

    def optimizer_step(self, *arguments: Any, **options: Any) -> None:
        """Steps, then averages the weights, before callbacks see the end of the batch."""
        super().optimizer_step(*arguments, **options)
        if self.average is not None:
            self.average.update(self.model)
        self.times.end(self.device)
        self.clock.count()

    @property
    def seconds(self) -> float:
        """Of training so far, all calls together."""
        return self.clock.seconds

    def costs(self) -> dict[str, float]:
        """Samples per second, peak memory (MB) and the share of time spent waiting for data."""
        return {
            "samples_per_second": self._samples_per_batch * self.clock.rate(self.batches_seen),
            "memory_mb": peak_memory(self._trained_on or self.device) / 1e6,
            "share_of_data": self.times.share_of_data,
        }

    def _common(self, seconds: float) -> float:
        several = self.trainer.world_size > 1
        return self.trainer.strategy.broadcast(seconds) if several else seconds

    def on_validation_start(self) -> None:
        """Stops the clock."""
        self.clock.count()

    def on_validation_end(self) -> None:
        """Starts the clock again."""
        self.clock.resume()

    def on_validation_epoch_start(self) -> None:
        """Validates the averaged weights."""
        self._swap = self.averaged()
        self._swap.__enter__()

    def on_validation_epoch_end(self) -> None:
        """Puts the trained weights back."""
        self._swap.__exit__(None, None, None)

    @contextmanager
    def averaged(self) -> Iterator[None]:
        """Within the block, the network holds the averaged weights."""
        with self.average.swapped(self.model) if self.average is not None else nullcontext():
            yield

    def on_save_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Saves the progress."""
        checkpoint["scenefw"] = {
            "recipe": self.model.recipe,
            "batches_seen": self.batches_seen,
            "samples_seen": self.samples_seen,
            "epochs_seen": self.epochs_seen,
            "facts": dict(self.describe()),
            "seconds": self.seconds,
            "batches_per_epoch": self.batches_per_epoch,
            "average": self.average.state_dict() if self.average is not None else None,
            "started_from": self.started_from,
            "optimized": self._optimized(),
        }

    def on_load_checkpoint(self, checkpoint: dict[str, Any]) -> None:
        """Restores the progress.

        Names of earlier versions become today's, and moments follow the names of their weights. The
        count of batches within an epoch means nothing to a leg whose epochs have other batches.
        """
        state = checkpoint["scenefw"]
        facts, before = (self.describe() if self.may_change else {}), renamed.facts(state["facts"])
        if any(before.get(name) != facts.get(name) for name in self.may_change):
            checkpoint.pop("loops", None)
        checkpoint["state_dict"] = {
            f"model.{renamed.weight(name.removeprefix('model.'))}": value
            for name, value in checkpoint["state_dict"].items()
        }
        places = {renamed.weight(n): place for place, n in enumerate(state.get("optimized", ()))}
        for optimizer in checkpoint.get("optimizer_states", ()) if places else ():
            stored = optimizer["state"]
            moments = [stored.get(places[name]) for name in self._optimized()]
            optimizer["state"] = {
                i: moment for i, moment in enumerate(moments) if moment is not None
            }
        self.batches_seen, self.clock.seconds = state["batches_seen"], state["seconds"]
        self.batches_per_epoch = state["batches_per_epoch"]
        self.samples_seen = state["samples_seen"]
        self.started_from = state.get("started_from", self.started_from)
        if self.average is not None and state["average"] is not None:
            values = {renamed.weight(n): v for n, v in state["average"]["values"].items()}
            self.average.load_state_dict({**state["average"], "values": values})

    def _optimized(self) -> list[str]:
        """Names of weights in the order in which the optimiser's state numbers them."""
        names = {id(weights): name for name, weights in self.model.named_parameters()}
        optimizer = self.optimizer.make(
            self.model, self.learning_rate, self.weight_decay, fused=False
        )
        return [names[id(w)] for group in optimizer.param_groups for w in group["params"]]
