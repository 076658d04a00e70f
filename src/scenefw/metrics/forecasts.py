"""Probabilities judged by what came true: log score, Brier score, calibration, reliability.

Forecasts of many voxels or pairs are kept as counts by classes of the forecast. Scores of any
calibrated forecast, which gives one probability per class, follow from these counts alone.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from scenefw.core.errors import InputError

Float64 = NDArray[np.float64]
Bool = NDArray[np.bool_]


@dataclass(frozen=True)
class Outcomes:
    """How often what was forecast came true, by class of the forecast.

    Args:
        total: (C,) events per class.
        true: (C,) of them, those that came true.
        forecast: (C,) sums of the probabilities that were given.
    """

    total: Float64
    true: Float64
    forecast: Float64

    @classmethod
    def of(
        cls, classes: NDArray[np.integer], probability: NDArray[np.floating], came: Bool, count: int
    ) -> "Outcomes":
        """Counts of events with a class in 0 .. count - 1, a probability and an outcome each."""
        flat = np.asarray(classes).ravel()
        weights = (None, np.asarray(came).ravel(), np.asarray(probability).ravel())
        sums = [np.bincount(flat, w, minlength=count).astype(np.float64) for w in weights]
        return cls(*sums)

    def __add__(self, other: "Outcomes") -> "Outcomes":
        """Both together."""
        return Outcomes(
            self.total + other.total, self.true + other.true, self.forecast + other.forecast
        )

    def frequencies(self, strength: float = 1.0) -> Float64:
        """Share (C,) that came true, drawn to the overall share as by `strength` more events.

        No class is ever certain, and one without events has the overall share.
        """
        overall = (self.true.sum() + 0.5) / (self.total.sum() + 1.0)
        return (self.true + strength * overall) / (self.total + strength)

    def calibrated(self, strength: float = 1.0) -> Float64:
        """Probabilities (C,) that never fall from one class to the next: isotonic frequencies.

        Barlow et al. 1972 (pool adjacent violators), on the frequencies above.
        """
        regression = isotonic_regression(
            self.frequencies(strength), weights=self.total + strength, increasing=True
        )
        return np.asarray(regression.x, dtype=np.float64)


def log_score(outcomes: Outcomes, probability: Float64) -> float:
    """Mean of -log of the probability given to what happened (nats); 0 is perfect.

    Args:
        outcomes: by class.
        probability: (C,) in (0, 1), of each class.

    Raises:
        InputError: there are other than C probabilities.
    """
    false = outcomes.total - outcomes.true
    _require_fit(outcomes, probability)
    costs = -outcomes.true * np.log(probability) - false * np.log1p(-probability)
    return _mean(costs, outcomes)


def brier_score(outcomes: Outcomes, probability: Float64) -> float:
    """Mean of the squared differences of probability and outcome (Brier 1950); 0 is perfect."""
    _require_fit(outcomes, probability)
    false = outcomes.total - outcomes.true
    return _mean(outcomes.true * (1 - probability) ** 2 + false * probability**2, outcomes)


def calibration_error(outcomes: Outcomes) -> float:
    """Mean over events of |forecast - frequency| of their class (expected calibration error)."""
    return _mean(np.abs(outcomes.forecast - outcomes.true), outcomes)


def log_odds_classes(probability: NDArray[np.floating], edges: Float64) -> NDArray[np.int64]:
    """The class of each probability: how many `edges` of log odds lie at or below its own."""
    value = np.asarray(probability, dtype=np.float64)
    with np.errstate(divide="ignore"):
        return np.searchsorted(edges, np.log(value) - np.log1p(-value), side="right")


def _require_fit(outcomes: Outcomes, probability: Float64) -> None:
    if np.shape(probability) != outcomes.total.shape:
        raise InputError(
            f"{len(outcomes.total)} classes of forecasts and probabilities of shape "
            f"{np.shape(probability)}; give one for each class"
        )


def _mean(costs: Float64, outcomes: Outcomes) -> float:
    events = outcomes.total.sum()
    return float(costs.sum() / events) if events else float("nan")


def count_score(samples: Float64, true: float) -> float:
    """Fair ranked probability score of drawn numbers (S,) (Ferro 2014): 0 is perfect.

    The mean distance to the true number minus half the mean distance among different draws, so
    that few independent draws score as many do on average. One number scores its distance.
    """
    count = len(samples)
    spread = np.abs(samples[:, None] - samples).sum() / max(count * (count - 1), 1)
    return float(np.abs(samples - true).mean() - 0.5 * spread)
