"""What happens beside the steps of a training: snapshots, the table of losses, the progress bar."""

import csv
import io
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
from torch import Tensor

from scenefw.core.files import append_text, replacing
from scenefw.learning.divergence import require_finite
from scenefw.learning.limits import Limits
from scenefw.learning.module import AGREE_EVERY, TrainingModule


class Snapshots(lightning.Callback):
    """Saves the whole training every few minutes and where it stops.

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
        """Saves if it is time, or the end."""
        if trainer.should_stop or self._due(trainer, module):
            self._save(trainer, module)

    def on_train_end(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Saves the end of it."""
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
        with module.clock_stopped():
            began = time.monotonic()
            trainer.save_checkpoint(self.path)  # all processes take part, the first one writes
            if self.export is not None and trainer.is_global_zero:
                self.export()
            self._last = time.monotonic()
            self.seconds, self._saved = self._last - began, module.batches_seen


class LossTable(lightning.Callback):
    """Writes losses and validation scores as one flat CSV: step, epoch, seconds, name, value.

    A resumed training first drops the rows that come after its snapshot.

    Args:
        path: of the file, appended to.
        every: steps between rows of the training losses, each the mean since the last.
    """

    def __init__(self, path: Path, every: int = 20) -> None:
        self.path, self.every = path, every
        self._sums: dict[str, Tensor] = {}
        self._count = 0

    def on_fit_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Starts the file, or cuts it back to where the training goes on."""
        if not trainer.is_global_zero:
            return
        rows = []
        if module.batches_seen and self.path.exists():
            with self.path.open(newline="", encoding="utf-8") as file:
                rows = [r for r in list(csv.reader(file))[1:] if int(r[0]) <= module.batches_seen]
        with replacing(self.path) as temporary, temporary.open("w", newline="") as file:
            csv.writer(file).writerows([["step", "epoch", "seconds", "name", "value"], *rows])

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Adds up, and writes the means every few steps."""
        self._count += 1
        for name, value in trainer.callback_metrics.items():
            if name.startswith("train/"):
                self._sums[name] = self._sums.get(name, 0.0) + value  # stays on the device
        if module.batches_seen % self.every == 0:
            means = {n: float(s) / self._count for n, s in self._sums.items()}
            self._write(trainer, module, means)
            self._sums, self._count = {}, 0

    def on_validation_end(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Writes the scores."""
        values = {n: float(v) for n, v in trainer.callback_metrics.items() if n.startswith("val/")}
        self._write(trainer, module, values)

    def _write(
        self, trainer: lightning.Trainer, module: TrainingModule, values: dict[str, float]
    ) -> None:
        if not trainer.is_global_zero:
            return
        epoch = max(module.batches_seen - 1, 0) // max(module.batches_per_epoch, 1)
        place = [module.batches_seen, epoch, f"{module.seconds:.1f}"]
        rows = io.StringIO(newline="")
        csv.writer(rows).writerows([[*place, n, f"{v:.6g}"] for n, v in values.items()])
        append_text(self.path, rows.getvalue())


class ProgressBar(lightning.Callback):
    """A rich bar with rate, memory, losses and time left, whichever limit comes first.

    Args:
        limits: say how far the training is.
        lines: print a plain line every this many seconds instead, for logs; None draws the bar.
    """

    def __init__(self, limits: Limits, lines: float | None = None) -> None:
        self.limits, self.lines = limits, lines
        self._bar: Progress | None = None
        self._printed = time.monotonic()

    def on_train_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Starts the bar."""
        if self.lines is None and trainer.is_global_zero:
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
        """Moves the bar."""
        now = time.monotonic()
        if now - self._printed < (self.lines or 0.5) or not trainer.is_global_zero:
            return
        self._printed = now
        rate = _rate(module)
        if self._bar is not None:
            self._bar.update(
                self._task,
                completed=self.limits.share(trainer, module),
                step=module.batches_seen,
                rate=rate,
                losses=_losses(trainer),
            )
        elif self.lines is not None:
            epoch = module.batches_seen // module.batches_per_epoch
            print(
                f"step {module.batches_seen} epoch {epoch}, {rate}, "
                f"{module.seconds:.0f} s {_losses(trainer)}",
                flush=True,
            )

    def on_train_end(self, trainer: lightning.Trainer, module: lightning.LightningModule) -> None:
        """Stops the bar."""
        self._stop()

    def on_exception(
        self, trainer: lightning.Trainer, module: lightning.LightningModule, error: BaseException
    ) -> None:
        """Stops the bar, so that the terminal is usable."""
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
