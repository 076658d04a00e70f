"""Stops a training whose weights became NaN or infinite, and keeps its last good snapshot."""

from typing import Any

import lightning
import torch
from torch import Tensor

from scenefw.core.errors import TrainingError
from scenefw.learning.module import TrainingModule


class Divergence(lightning.Callback):
    """Stops a training that diverged, before anything is saved.

    Args:
        every: steps between checks; each check waits for the device.
    """

    def __init__(self, every: int = 20) -> None:
        self.every = every

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Checks the weights now and then.

        Raises:
            TrainingError: some are not finite.
        """
        if module.batches_seen % self.every == 0:
            require_finite(module)


def require_finite(module: TrainingModule) -> None:
    """Checks all weights of a training.

    Raises:
        TrainingError: some are NaN or infinite.
    """
    values = [p.detach() for p in module.model.parameters()]
    if values and not bool(_all_finite(values)):
        raise TrainingError(
            f"the training diverged: weights are NaN or infinite after step {module.batches_seen}; "
            "start over (run.fresh=true) with a lower learning.learning_rate, or with "
            "trainer.precision=32-true"
        )


def _all_finite(values: list[Tensor]) -> Tensor:
    norms: list[Tensor] = list(torch._foreach_norm(values, torch.inf))
    return torch.isfinite(torch.stack([norm.float() for norm in norms])).all()
