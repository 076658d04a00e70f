"""How sure a prediction is of each object, from how alike several latent samples are."""

import json
from collections.abc import Sequence
from importlib.resources import files

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.optimize import isotonic_regression
from torch import Tensor

from scenefw.core.errors import ConfigError

_LEAST = 30  # objects of a knot
_KNOTS = 24


class Calibration:
    """From how alike samples are to the IoU with the truth that is to be expected.

    Between knots it is linear, outside them constant.

    Args:
        said: (K,) agreement of samples, rising.
        expected: (K,) mean IoU with the truth, not falling.

    Raises:
        ConfigError: numbers outside [0, 1], in another order, or not as many of both.
    """

    def __init__(self, said: Sequence[float], expected: Sequence[float]) -> None:
        knots, values = np.asarray(said, np.float64), np.asarray(expected, np.float64)
        ratios = np.concatenate([knots, values])
        if len(knots) != len(values) or not len(knots) or not ((ratios >= 0) & (ratios <= 1)).all():
            raise ConfigError(
                f"a calibration has said {list(said)} and expected {list(expected)}; give as many "
                "of both, from 0 to 1"
            )
        if (np.diff(knots) <= 0).any() or (np.diff(values) < 0).any():
            raise ConfigError(
                f"said {list(said)} must rise, and expected {list(expected)} must not fall"
            )
        self.said, self.expected = knots, values

    @classmethod
    def shipped(cls, name: str) -> "Calibration":
        """The calibration that was measured for a method, `assets/NAME_calibration.json`."""
        text = (files("scenefw") / "assets" / f"{name}_calibration.json").read_text(
            encoding="utf-8"
        )
        content = json.loads(text)
        return cls(content["said"], content["expected"])

    def __call__(self, agreement: ArrayLike) -> np.ndarray:
        """Expected IoU for agreements of any shape."""
        return np.interp(np.asarray(agreement, np.float64), self.said, self.expected)

    @classmethod
    def fitted(cls, agreements: ArrayLike, truth: ArrayLike) -> "Calibration":
        """The calibration that explains some objects: groups of equal size, then isotonic.

        Args:
            agreements: (N,) agreement of samples, N > 0.
            truth: (N,) IoU with the truth.
        """
        agreement, overlap = np.asarray(agreements, np.float64), np.asarray(truth, np.float64)
        order = agreement.argsort(kind="stable")
        groups = np.array_split(order, max(min(_KNOTS, len(order) // _LEAST), 1))
        knots = np.array([agreement[group].mean() for group in groups])
        values = np.array([overlap[group].mean() for group in groups])
        weights = np.array([float(len(group)) for group in groups])
        smooth = isotonic_regression(values, weights=weights).x
        distinct = np.concatenate([[True], np.diff(knots) > 1e-6])
        return cls(knots[distinct].clip(0, 1).tolist(), smooth[distinct].clip(0, 1).tolist())


def confidences(
    instances: Tensor, samples: Sequence[Tensor], calibration: Calibration | None = None
) -> dict[int, float]:
    """Mean over samples of the largest IoU of an object with any of theirs.

    That is the IoU with the truth to expect if the truth were as likely as any sample. Without
    samples nothing is known of the spread and every confidence is 1.

    Args:
        instances: (X, Y, Z) labels whose objects are judged.
        samples: label volumes of the same shape, numbered in any way.
        calibration: what is expected, given that mean; None takes it as it is.

    Returns:
        By label, in [0, 1].
    """
    labels = _array(instances)
    ids = np.unique(labels[labels > 0])
    if not samples:
        return {int(i): 1.0 for i in ids}
    sample_overlaps = np.stack([best_overlaps(labels, ids, _array(sample)) for sample in samples])
    means = sample_overlaps.mean(axis=0)
    means = means if calibration is None else calibration(means)
    return {int(i): float(mean) for i, mean in zip(ids, means, strict=True)}


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
