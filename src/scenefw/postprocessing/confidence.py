"""How sure a prediction is of each object, from how alike several latent samples are."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor


def confidences(
    instances: Tensor, samples: Sequence[Tensor], threshold: float = 0.5
) -> dict[int, float]:
    """Share of samples that show an object too, times how well they agree with it on its voxels.

    A sample shows an object if one of its instances overlaps it with an IoU of at least
    `threshold`. The confidence is the mean over the samples of that IoU, 0 for samples that do not
    show it. Without samples nothing is known of the spread and every confidence is 1.

    Args:
        instances: (X, Y, Z) labels whose objects are judged.
        samples: label volumes of the same shape, numbered in any way.
        threshold: least IoU of "the same object".

    Returns:
        By label, in [0, 1].
    """
    labels = _array(instances)
    ids = np.unique(labels[labels > 0])
    if not samples:
        return {int(i): 1.0 for i in ids}
    found = np.stack([_best_overlap(labels, ids, _array(sample)) for sample in samples])
    means = np.where(found >= threshold, found, 0.0).mean(axis=0)
    return {int(i): float(mean) for i, mean in zip(ids, means, strict=True)}


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
