"""Learning rates as functions of progress, so that resuming needs no state."""

import math
from dataclasses import dataclass
from typing import Protocol, TypeVar

from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.settings import COUNT, PART


@dataclass(frozen=True)
class Progress:
    """Progress of a training: steps, epochs, seconds, and the finished share of this epoch."""

    step: int
    epoch: int
    seconds: float
    share: float = 0.0


Number = TypeVar("Number", int, float)


def limit(amount: Number | None, name: str) -> Number | None:
    """A limit of a training; None or -1 means no limit.

    Args:
        amount: steps, epochs or minutes.
        name: the setting that holds it.

    Raises:
        ConfigError: it is 0, or another negative number.
    """
    if amount is None or amount == -1:
        return None
    if not amount > 0:
        raise SettingError(name, amount, "more than 0, or -1 for no limit")
    return amount


class Schedule(Protocol):
    """Factor of the learning rate."""

    def factor(self, progress: Progress) -> float:
        """Multiplies the learning rate of the next step."""

    def budget_share(self, progress: Progress) -> float:
        """Share of the budget that is used up, at most 1; 1 without a budget."""


class StepDecay:
    """Times `factor` every `every` epochs (thesis 5.2.3: 0.99 every 5).

    Args:
        decay: factor of each drop.
        every: epochs between drops.
        warmup: steps over which the rate rises from 0; for weights with a fresh optimiser.
    """

    def __init__(self, decay: float = 0.99, every: int = 5, warmup: int = 0) -> None:
        PART.require(decay=decay)
        COUNT.require(every=every)
        self.decay, self.every, self.warmup = decay, every, warmup

    def factor(self, progress: Progress) -> float:
        """Multiplies the learning rate of the next step."""
        return _rise(progress, self.warmup) * self.decay ** (progress.epoch // self.every)

    def budget_share(self, progress: Progress) -> float:
        """1, as there is no budget."""
        return 1.0


class ExponentialDecay:
    """Times `decay` over every `every` steps, step by step (thesis 4.7.1: 0.96 over 1e5 steps).

    Args:
        decay: factor after `every` steps.
        every: steps.
        warmup: steps over which the rate rises from 0; for weights with a fresh optimiser.
    """

    def __init__(self, decay: float = 0.96, every: int = 100_000, warmup: int = 0) -> None:
        PART.require(decay=decay)
        COUNT.require(every=every)
        self.decay, self.every, self.warmup = decay, every, warmup

    def factor(self, progress: Progress) -> float:
        """Multiplies the learning rate of the next step."""
        return _rise(progress, self.warmup) * self.decay ** (progress.step / self.every)

    def budget_share(self, progress: Progress) -> float:
        """1, as there is no budget."""
        return 1.0


class CosineDecay:
    """Warm-up, then half a cosine down to `lowest` over a budget of steps, epochs or time.

    Args:
        steps: the budget in steps; None or -1 means no limit.
        minutes: the budget in minutes of training; None or -1 means no limit. With several budgets,
            what is nearer its end counts.
        warmup: steps over which the rate rises from 0.
        lowest: factor at the end.
        epochs: the budget in passes over the training data; None or -1 means no limit.
    """

    def __init__(
        self,
        steps: int | None = None,
        minutes: float | None = None,
        warmup: int = 100,
        lowest: float = 0.01,
        epochs: int | None = None,
    ) -> None:
        self.steps = limit(steps, "steps")
        self.epochs = limit(epochs, "epochs")
        self.minutes = limit(minutes, "minutes")
        if not self.steps and not self.minutes and not self.epochs:
            raise ConfigError(
                "a cosine schedule needs a budget: learning.schedule.steps, .minutes or .epochs; "
                "give size.minutes or trainer.max_epochs"
            )
        self.warmup, self.lowest = warmup, lowest

    def factor(self, progress: Progress) -> float:
        """Multiplies the learning rate of the next step."""
        cosine = 0.5 * (1 + math.cos(math.pi * self.budget_share(progress)))
        return _rise(progress, self.warmup) * (self.lowest + (1 - self.lowest) * cosine)

    def budget_share(self, progress: Progress) -> float:
        """Share of the budget that is used up, at most 1."""
        share = progress.step / self.steps if self.steps else 0.0
        if self.minutes:
            share = max(share, progress.seconds / (60 * self.minutes))
        if self.epochs:
            share = max(share, (progress.epoch + progress.share) / self.epochs)
        return min(share, 1.0)


def _rise(progress: Progress, warmup: int) -> float:
    """Factor within the warm-up, 1 after it."""
    return min((progress.step + 1) / max(warmup, 1), 1.0)
