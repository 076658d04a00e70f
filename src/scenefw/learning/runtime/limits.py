"""When a training ends, and when only the current call does."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import lightning

from scenefw.core.errors import ConfigError
from scenefw.learning.module import TrainingModule
from scenefw.learning.resumable import AGREE_EVERY


@dataclass(frozen=True)
class Budget:
    """The limits of a training over all its calls; None means no limit.

    Args:
        steps: optimiser steps.
        epochs: passes over the training data.
        minutes: of training, without validation and snapshots.
    """

    steps: int | None = None
    epochs: int | None = None
    minutes: float | None = None

    def shares(self, steps: int, epochs: float, seconds: float) -> dict[str, tuple[float, str]]:
        """By setting: the used share of its limit (1 = all), also in words."""
        usage = {
            "max_steps": (steps, self.steps, f"{steps} of {self.steps} steps"),
            "max_epochs": (epochs, self.epochs, f"{epochs:.4g} of {self.epochs} epochs"),
            "max_minutes": (
                seconds / 60,
                self.minutes,
                f"{seconds / 60:.1f} of {self.minutes} minutes",
            ),
        }
        return {
            name: (spent / limit, words)
            for name, (spent, limit, words) in usage.items()
            if limit is not None
        }


def finished(budget: Budget, state: dict[str, Any]) -> str | None:
    """Says in one line that a stored training has finished, and how to continue it."""
    mine = state["scenefw"]
    steps = mine["batches_seen"]
    epochs = mine.get("epochs_seen", steps / (mine.get("batches_per_epoch") or steps + 1))
    shares = budget.shares(steps, epochs, mine["seconds"])
    limits = [(words, name) for name, (share, words) in shares.items() if share >= 1]
    if not limits:
        return None
    raised = " and ".join(f"trainer.{name}" for _, name in limits)
    return (
        f"the training is finished: {', '.join(w for w, _ in limits)}; to continue raise {raised}"
    )


class Limits(lightning.Callback):
    """Stops a training at its budget, or a call of it in time to validate and save.

    Args:
        budget: of the whole training.
        call: seconds of this call; None means no limit.
        saving: says how many seconds the last snapshot took.
        clock: seconds, ever rising.
        began: when the call began, by that clock; None means now.
    """

    def __init__(
        self,
        budget: Budget,
        call: float | None = None,
        saving: Callable[[], float] = lambda: 0.0,
        clock: Callable[[], float] = time.monotonic,
        began: float | None = None,
    ) -> None:
        self.budget, self.call, self.saving, self.clock = budget, call, saving, clock
        self._stepped = clock()
        self._began = self._stepped if began is None else began
        self._step = self._validation = self._validating = 0.0

    def share(self, trainer: lightning.Trainer, module: TrainingModule) -> float:
        """The used share of the nearest limit."""
        shares = [share for share, _ in self._shares(module).values()]
        call = (self.clock() - self._began) / self.call if self.call else 0.0
        return min(max([call, *shares]), 1.0)

    def on_train_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Starts timing steps."""
        self._stepped = self.clock()

    def on_train_batch_end(
        self, trainer: lightning.Trainer, module: TrainingModule, *_: Any
    ) -> None:
        """Stops at a limit."""
        now = self.clock()
        self._step, self._stepped = now - self._stepped, now
        shares = self._shares(module)
        counted = any(shares.get(n, (0, ""))[0] >= 1 for n in ("max_steps", "max_epochs"))
        if counted or self._is_over(trainer, module, shares.get("max_minutes", (0, ""))[0] >= 1):
            trainer.should_stop = True

    def on_validation_start(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Times the validation, as one ends every call."""
        self._validating = self.clock()

    def on_validation_end(self, trainer: lightning.Trainer, module: TrainingModule) -> None:
        """Keeps the longest."""
        self._stepped = self.clock()
        self._validation = max(self._validation, self._stepped - self._validating)

    def _is_over(self, trainer: lightning.Trainer, module: TrainingModule, over: bool) -> bool:
        """Whether time is over; several processes use the first one's clock, now and then."""
        several = trainer.world_size > 1
        if several and module.batches_seen % AGREE_EVERY:
            return False
        steps = (AGREE_EVERY if several else 1) * self._step
        ending = steps + self._validation + self.saving()
        over |= self.call is not None and self.clock() - self._began + ending >= self.call
        return bool(trainer.strategy.broadcast(over)) if several else over

    def _shares(self, module: TrainingModule) -> dict[str, tuple[float, str]]:
        return self.budget.shares(module.batches_seen, module.epochs_seen, module.seconds)


def seconds_of(time_limit: str | None) -> float | None:
    """Seconds of DD:HH:MM:SS.

    Raises:
        ConfigError: it is written in another way.
    """
    if time_limit is None:
        return None
    match = re.fullmatch(r"(\d+):(\d\d):(\d\d):(\d\d)", str(time_limit).strip())
    if match is None:
        raise ConfigError(
            f"trainer.max_time={time_limit} is not a time; give DD:HH:MM:SS, for nine minutes "
            "00:00:09:00"
        )
    days, hours, minutes, seconds = map(int, match.groups())
    return float(((days * 24 + hours) * 60 + minutes) * 60 + seconds)
