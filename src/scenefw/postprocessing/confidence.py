"""How sure a prediction is of each object, from what it knows without the truth."""

import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.optimize import minimize
from scipy.special import expit
from torch import Tensor

from scenefw.core.errors import ConfigError

_RIDGE = 1e-3  # of weights per standard deviation; so small that it only tells apart equal fits
_MIN_SCALE = 1e-9  # a number that varies less says nothing
_BOUNDS = {1: (0, None), -1: (None, 0), 0: (None, None)}


class ExpectedOverlap:
    """The IoU with the truth to expect of objects: a logistic function of numbers about each.

    Args:
        names: of the K numbers.
        centre: (K,) their mean where they were fitted.
        scale: (K,) their standard deviation there.
        weights: (K,) of the numbers less the centre, in units of the scale.
        intercept: logit of the IoU at the centre.

    Raises:
        ConfigError: not as many of all, or numbers that aren't finite, or no positive scale.
    """

    def __init__(
        self,
        names: Sequence[str],
        centre: ArrayLike,
        scale: ArrayLike,
        weights: ArrayLike,
        intercept: float,
    ) -> None:
        self.names, self.intercept = tuple(names), float(intercept)
        self.centre, self.scale, self.weights = (
            np.asarray(values, np.float64) for values in (centre, scale, weights)
        )
        numbers = [*self.centre, *self.scale, *self.weights, self.intercept]
        sizes = {len(self.names), len(self.centre), len(self.scale), len(self.weights)}
        if len(sizes) > 1 or not np.isfinite(numbers).all() or not (self.scale > 0).all():
            raise ConfigError(
                f"a calibration of {', '.join(self.names)} needs a finite centre, scale above 0 "
                "and weight of each; fit it again with experiment=confidence"
            )

    @classmethod
    def shipped(cls, name: str) -> "ExpectedOverlap":
        """The calibration that was fitted for a method, `assets/NAME_calibration.json`."""
        path = files("scenefw") / "assets" / f"{name}_calibration.json"
        return cls.of(json.loads(path.read_text(encoding="utf-8")))

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "ExpectedOverlap":
        """The calibration that `content` describes.

        Raises:
            ConfigError: it lacks something.
        """
        try:
            rows = content["numbers"]
            centre, scale, weights = (
                [row[key] for row in rows.values()] for key in ("centre", "scale", "weight")
            )
            return cls(list(rows), centre, scale, weights, content["intercept"])
        except (KeyError, TypeError, AttributeError) as error:
            raise ConfigError(
                f"a calibration lacks {error}; fit it again with experiment=confidence"
            ) from error

    @property
    def content(self) -> dict[str, Any]:
        """Itself as JSON types."""
        rows = zip(self.names, self.centre, self.scale, self.weights, strict=True)
        return {
            "intercept": self.intercept,
            "numbers": {
                name: {"centre": float(centre), "scale": float(scale), "weight": float(weight)}
                for name, centre, scale, weight in rows
            },
        }

    def __call__(self, numbers: ArrayLike) -> np.ndarray:
        """Expected IoU (N,) of objects by their numbers (N, K)."""
        rows = (np.asarray(numbers, np.float64) - self.centre) / self.scale
        return np.asarray(expit(rows @ self.weights + self.intercept))

    @classmethod
    def fitted(
        cls, signs: Mapping[str, int], numbers: ArrayLike, overlaps: ArrayLike
    ) -> "ExpectedOverlap":
        """The calibration that explains objects best: least cross-entropy, with a small ridge.

        Args:
            signs: by name of the number: 1 if the IoU may only rise with it, -1 if it may only
                fall, 0 if either.
            numbers: (N, K) of the objects, N > 0.
            overlaps: (N,) their IoU with the truth.
        """
        rows, truth = np.asarray(numbers, np.float64), np.asarray(overlaps, np.float64)
        centre, scale = rows.mean(axis=0), rows.std(axis=0)
        scale = np.where(scale > _MIN_SCALE, scale, 1.0)
        rows = (rows - centre) / scale

        def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
            logits = rows @ parameters[1:] + parameters[0]
            slope = (expit(logits) - truth) / len(truth)
            value = (np.logaddexp(0, logits) - truth * logits).mean()
            ridge = _RIDGE * parameters[1:]
            gradient = np.concatenate([[slope.sum()], slope @ rows + ridge])
            return float(value + ridge @ parameters[1:] / 2), gradient

        bounds = [(None, None), *(_BOUNDS[sign] for sign in signs.values())]
        best = minimize(loss, np.zeros(len(bounds)), jac=True, method="L-BFGS-B", bounds=bounds)
        return cls(list(signs), centre, scale, best.x[1:], best.x[0])


def agreements(instances: Tensor, samples: Sequence[Tensor]) -> dict[int, float]:
    """Mean over samples of the largest IoU of an object with any of theirs.

    That is the IoU with the truth to expect if the truth were as likely as any sample. Without
    samples nothing is known of the spread and every agreement is 1.

    Args:
        instances: (X, Y, Z) labels whose objects are judged.
        samples: label volumes of the same shape, numbered in any way.

    Returns:
        By label, in [0, 1].
    """
    labels = _array(instances)
    ids = np.unique(labels[labels > 0])
    if not samples:
        return {int(i): 1.0 for i in ids}
    sample_overlaps = np.stack([best_overlaps(labels, ids, _array(sample)) for sample in samples])
    return {int(i): float(mean) for i, mean in zip(ids, sample_overlaps.mean(axis=0), strict=True)}


def best_overlaps(labels: np.ndarray, ids: np.ndarray, sample_labels: np.ndarray) -> np.ndarray:
    """Largest IoU of each object with any instance of another labelling.

    Args:
        labels: (X, Y, Z) int64.
        ids: (N,) of the objects.
        sample_labels: (X, Y, Z) int64.
    """
    width = int(sample_labels.max(initial=0)) + 1
    pairs = np.bincount(labels.ravel() * width + sample_labels.ravel(), minlength=width)
    pairs = np.pad(pairs, (0, -len(pairs) % width)).reshape(-1, width)
    sizes = np.bincount(sample_labels.ravel(), minlength=width)
    inner = pairs[ids, 1:]
    union = pairs[ids].sum(axis=1)[:, None] + sizes[None, 1:] - inner
    return (inner / np.maximum(union, 1)).max(axis=1, initial=0.0)


def _array(labels: Tensor | ArrayLike) -> np.ndarray:
    values = labels.cpu().numpy() if isinstance(labels, torch.Tensor) else np.asarray(labels)
    return values.astype(np.int64)
