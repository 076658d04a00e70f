"""Masks with scores, as promptable segmenters give them, as one image of ids."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenefw.core.errors import InputError


def ids_of_masks(masks: ArrayLike, scores: ArrayLike | None = None) -> NDArray[np.int32]:
    """An image of ids (H, W): the first mask is 1, the second 2, ...; 0 = in none.

    A pixel of several masks is of the one with the highest score, so a mask may lose all of its
    pixels to better ones. Without scores smaller masks are better: a thing lies on what is larger.

    Args:
        masks: (N, H, W); above 0 is in a mask.
        scores: (N,), higher is better.

    Raises:
        InputError: other shapes, or scores that are no finite numbers.
    """
    stack = np.asarray(masks)
    if stack.ndim != 3 or stack.dtype.kind not in "buif" or not len(stack):
        raise InputError(
            f"masks have shape {stack.shape} and are of {stack.dtype}; give (N, H, W) booleans, a "
            "mask each"
        )
    stack = stack > 0
    if scores is None:
        ranks = -stack.sum(axis=(1, 2)).astype(np.float64)
    else:
        ranks = np.asarray(scores)
        if ranks.dtype.kind not in "uif" or ranks.shape != stack.shape[:1]:
            raise InputError(
                f"scores have shape {ranks.shape} and are of {ranks.dtype}; give {len(stack)} "
                "numbers, one of each mask"
            )
        if not np.isfinite(ranks).all():
            raise InputError("scores hold NaN or infinity; give a finite number of each mask")
    ids = np.zeros(stack.shape[1:], dtype=np.int32)
    for number in np.argsort(ranks, kind="stable"):
        ids[stack[number]] = number + 1
    return ids
