"""Callbacks of a training: snapshots and the progress bar."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lightning
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from scenefw.learning.module import TrainingModule
from scenefw.learning.resumable import AGREE_EVERY
from scenefw.learning.runtime.divergence import require_finite
from scenefw.learning.runtime.limits import Limits


class Snapshots(lightning.Callback):
    """Saves the whole training every few minutes and when it stops.

    The state is that of a step within an epoch, not that of an epoch's end, so that a training in
    many calls has the epochs of one in a single call. A training that diverged is not saved: it
    raises a TrainingError instead.

    Args:
        path: of the file, replaced atomically.
        minutes: time between snapshots.
        steps: steps between snapshots instead, if given.
        export: called after each snapshot.
    """

    def __init__(
        self,
        path: Path,
        minutes: float = 3.0,
        steps: int | None = None,
        export: Callable[[], None] | None = None,
    ) -> None:
        self.path, self.minutes, self.steps, self.export = path, minutes, steps, export
        self.seconds = 0.0
        """What the last one took."""
        self._last, self._saved = time.monotonic(), -1

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Saves if it is time, or at the end."""
        if trainer.should_stop or self._due(trainer, module):
            self._save(trainer, module)

    def on_train_end(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Saves the final state."""
        if self._saved != module.batches_seen:
            self._save(trainer, module)

    def _due(self, trainer: lightning.Trainer, module: TrainingModule) -> bool:
        if self.steps:
            return module.batches_seen % self.steps == 0
        due = time.monotonic() - self._last >= 60 * self.minutes
        if trainer.world_size == 1:
            return due
        if module.batches_seen % AGREE_EVERY:
            return False
        return bool(trainer.strategy.reduce_boolean_decision(due, all=False))  # save together

    def _save(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        require_finite(module)
        with module.clock.stopped():
            began = time.monotonic()
            trainer.save_checkpoint(self.path)  # all processes take part, the first one writes
            if self.export is not None and trainer.is_global_zero:
                self.export()
            self._last = time.monotonic()
            self.seconds, self._saved = self._last - began, module.batches_seen


class ProgressBar(lightning.Callback):
    """A rich bar with rate, memory, losses and time left, whichever limit comes first.

    Without a terminal it prints lines instead (setting `callback`).

    Args:
        lines: seconds between lines without a terminal.
        bar: draw the bar: true, false, or null where there is a terminal.
    """

    def __init__(self, lines: float = 60.0, bar: bool | None = None) -> None:
        self.interval = lines
        self.has_bar = sys.stdout.isatty() if bar is None else bar
        self._bar: Progress | None = None
        self._printed = time.monotonic()

    def on_train_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Starts the bar."""
        self._limits = next((c for c in trainer.callbacks if isinstance(c, Limits)), None)
        if self.has_bar and trainer.is_global_zero:
            self._bar = Progress(
                TextColumn("training"),
                BarColumn(),
                TaskProgressColumn(),
                TextColumn("step {task.fields[step]}, {task.fields[rate]}"),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                TextColumn("{task.fields[losses]}"),
            )
            self._bar.start()
            self._task = self._bar.add_task("", total=1.0, step=0, rate="", losses="")

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Updates the bar."""
        now = time.monotonic()
        wait = 0.5 if self.has_bar else self.interval
        if now - self._printed < wait or not trainer.is_global_zero:
            return
        self._printed = now
        rate = _rate(module)
        if self._bar is not None:
            self._bar.update(
                self._task,
                completed=self._limits.share(trainer, module) if self._limits else 0.0,
                step=module.batches_seen,
                rate=rate,
                losses=_losses(trainer),
            )
        elif not self.has_bar:
            print(
                f"step {module.batches_seen} epoch {int(module.epochs_seen)}, {rate}, "
                f"{module.seconds:.0f} s {_losses(trainer)}",
                flush=True,
            )

    def on_train_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Stops the bar."""
        self._stop()

    def on_exception(
        self, trainer: lightning.Trainer, module: lightning.LightningModule, error: BaseException
    ) -> None:
        """Stops the bar and restores the terminal."""
        self._stop()

    def _stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None


def _rate(module: TrainingModule) -> str:
    costs = module.costs()
    return (
        f"{costs['samples_per_second']:.1f} samples/s, {costs['memory_mb'] / 1e3:.1f} GB, "
        f"{costs['share_of_data']:.0%} waiting for data"
    )


def _losses(trainer: lightning.Trainer) -> str:
    values = {n: float(v) for n, v in trainer.callback_metrics.items()}
    return " ".join(f"{name.split('/')[1]} {value:.3f}" for name, value in values.items())
