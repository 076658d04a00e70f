"""How sure a prediction is of each object, from how alike several latent samples are."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor


def confidences(instances: Tensor, samples: Sequence[Tensor]) -> dict[int, float]:
    """Mean over samples of the largest IoU of an object with any of theirs.

    That is the IoU with the truth to expect if the truth were as likely as any sample. Without
    samples nothing is known of the spread and every confidence is 1.

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
    found = np.stack([_best_overlap(labels, ids, _array(sample)) for sample in samples])
    return {int(i): float(mean) for i, mean in zip(ids, found.mean(axis=0), strict=True)}


def _best_overlap(labels: np.ndarray, ids: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Largest IoU of each object with any instance of another labelling."""
    width = int(other.max(initial=0)) + 1
    pairs = np.bincount(labels.ravel() * width + other.ravel(), minlength=width)
    pairs = np.pad(pairs, (0, -len(pairs) % width)).reshape(-1, width)
    sizes = np.bincount(other.ravel(), minlength=width)
    inner = pairs[ids, 1:]
    union = pairs[ids].sum(axis=1)[:, None] + sizes[None, 1:] - inner
    return (inner / np.maximum(union, 1)).max(axis=1, initial=0.0)


def _array(labels: Tensor | ArrayLike) -> np.ndarray:
    values = labels.cpu().numpy() if isinstance(labels, torch.Tensor) else np.asarray(labels)
    return values.astype(np.int64)
