"""Passes losses and validation scores to the loggers of a training."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import lightning
from torch import Tensor

from scenefw.core.training_protocols import TrainingLogger
from scenefw.learning.module import TrainingModule


class Recording(lightning.Callback):
    """Gives every logger the means of losses every few steps, and the scores of validations.

    Losses are added up on the device, which is waited for only when they are handed over.

    Args:
        loggers: by name.
        folder: of the training.
        interval: steps between losses, each the mean since the last.
    """

    def __init__(
        self, loggers: Mapping[str, TrainingLogger], folder: Path, interval: int = 20
    ) -> None:
        self.loggers, self.folder, self.interval = dict(loggers), folder, interval
        self._sums: dict[str, Tensor] = {}
        self._count = 0

    def on_fit_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Starts all loggers, or resumes them where the training is."""
        if trainer.is_global_zero:
            for logger in self.loggers.values():
                logger.begin(self.folder, module.batches_seen)

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Adds up losses, and logs their means every few steps."""
        if not trainer.is_global_zero or not self.loggers:
            return
        self._count += 1
        for name, value in trainer.callback_metrics.items():
            if name.startswith("train/"):
                self._sums[name] = self._sums.get(name, 0.0) + value  # stays on the device
        if module.batches_seen % self.interval == 0:
            self._log(module, {n: float(s) / self._count for n, s in self._sums.items()})
            self._sums, self._count = {}, 0

    def on_validation_end(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Logs the scores."""
        metrics = trainer.callback_metrics.items()
        if trainer.is_global_zero:
            self._log(module, {n: float(v) for n, v in metrics if n.startswith("val/")})

    def teardown(
        self, trainer: lightning.Trainer, module: lightning.LightningModule, stage: str
    ) -> None:
        """Closes all loggers, also after an error."""
        if trainer.is_global_zero:
            for logger in self.loggers.values():
                logger.end()

    def _log(self, module: TrainingModule, values: Mapping[str, float]) -> None:
        epoch = max(module.batch_number - 1, 0) // max(module.batches_per_epoch, 1)
        for logger in self.loggers.values():
            logger.log(module.batches_seen, epoch, module.seconds, values)
