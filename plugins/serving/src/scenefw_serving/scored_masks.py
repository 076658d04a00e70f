"""Masks with scores, as promptable segmenters give them, as one image of ids."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenefw.core.errors import InputError


def pixels_of(mask: NDArray[Any], name: str) -> NDArray[np.bool_]:
    """Which pixels (H, W) are in a mask of one object; it may be empty.

    Args:
        mask: (H, W) booleans, whole numbers of one value above 0, or floats of 0 and 1.
        name: of the mask, for messages.

    Raises:
        InputError: it has several values, as soft edges, JPEG, probabilities and ids have.
    """
    pixels = mask > 0
    if mask.dtype.kind == "f":
        is_sharp = (mask == pixels).all()
    else:
        is_sharp = (mask[pixels] == mask.max(initial=0)).all()
    if not is_sharp:
        raise InputError(
            f"{name} has several values, as probabilities, soft edges and JPEG do; threshold it: 0 "
            "outside the object, 1 in it"
        )
    return pixels


def ids_of_masks(
    masks: ArrayLike, scores: ArrayLike | None = None
) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    """An image of ids (H, W), and a line of each mask that has no pixel in it.

    The first mask is 1, the second 2, ...; 0 = in none. A pixel of several masks is of the one with
    the highest score, so a mask may lose all of its pixels to better ones. Without scores smaller
    masks are better: a thing lies on what is larger.

    Args:
        masks: (N, H, W), each as `pixels_of` takes it.
        scores: (N,), higher is better.

    Raises:
        InputError: other shapes or values, or scores that are no finite numbers.
    """
    stack = np.asarray(masks)
    if stack.ndim != 3 or stack.dtype.kind not in "buif" or not len(stack):
        raise InputError(
            f"masks have shape {stack.shape} and are of {stack.dtype}; give (N, H, W) booleans, a "
            "mask each"
        )
    stack = np.stack([pixels_of(mask, f"mask {n}") for n, mask in enumerate(stack, start=1)])
    sizes = stack.sum(axis=(1, 2))
    if scores is None:
        ranks = -sizes.astype(np.float64)
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
    absent = sorted(set(range(1, len(stack) + 1)) - set(np.unique(ids).tolist()))
    reasons = {n: "other masks have all of its pixels" for n in absent if sizes[n - 1]}
    return ids, tuple(
        f"object {n} of the masks is left out: {reasons.get(n, 'its mask holds no pixel')}"
        for n in absent
    )
