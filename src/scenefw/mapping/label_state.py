"""Checks and initial values that both ways of fusing labels share."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid
from scenefw.core.labelling_protocols import State
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.types import Frame

_SLACK = 0.02  # how far sums of half-precision probabilities may be from 1
_LEAST = 1e-7  # probability taken from a map file, where float16 may have made it 0


def require_settings(floor: float, angle_power: float, classes: int = 2) -> None:
    """Raises a ConfigError unless the floor leaves room for `classes` and the power is >= 0."""
    if classes < 2:
        raise ConfigError(f"labels need 2 classes or more, got {classes}")
    if not 0 < floor < 1 / classes:
        raise ConfigError(
            f"the smallest likelihood of {classes} classes is floor = {floor}; expected more than "
            f"0 and less than {1 / classes:.3g}"
        )
    NOT_NEGATIVE.require(angle_power=angle_power)


def require_labels(probabilities: NDArray[np.float32], frame: Frame, classes: int) -> Tensor:
    """Returns per-pixel distributions (C, H, W) as contiguous float32, nothing below 0.

    Raises:
        InputError: another shape, not finite, or no probabilities that add up to 1.
    """
    values = np.ascontiguousarray(probabilities, dtype=np.float32)
    expected = (classes, *frame.depth.shape)
    if values.shape != expected:
        raise InputError(
            f"probabilities of {frame.name or 'a frame'} have shape {values.shape}, expected "
            f"{expected}: classes, then the size of its depth image"
        )
    if not np.isfinite(values.sum()):
        raise InputError(
            f"probabilities of {frame.name or 'a frame'} are not all finite; check the network"
        )
    sums = values.sum(axis=0)
    if values.min() < -_SLACK or np.abs(sums - 1).max() > _SLACK:
        raise InputError(
            f"probabilities of {frame.name or 'a frame'} lie in {values.min():.3g} to "
            f"{values.max():.3g} and add up to {sums.min():.3g} to {sums.max():.3g}; expected 0 to "
            "1 that add up to 1 (scores need a softmax, percent a division by 100)"
        )
    return torch.from_numpy(np.maximum(values, 0))  # fusion takes logarithms


def start_logits(
    logits: Tensor,
    finest: slice,
    grid: HeightGrid,
    previous: NDArray[np.float32] | None,
    state: State | None,
) -> None:
    """Fills the logits (N, C) of a new fusion, which are zeros, with what it resumes from.

    Args:
        logits: of the vertices of all levels.
        finest: those of the finest level.
        grid: the vertices.
        previous: (C, V, V) of an earlier map; not read if there is a state.
        state: of a saved fusion; None = none was kept.

    Raises:
        InputError: the earlier probabilities or state have another grid or other classes.
    """
    if state is not None:
        logits.copy_(restored_logits(state, logits.shape))
    elif previous is not None:
        logits[finest] = initial_logits(previous, grid, logits.shape[1]).to(logits)


def initial_logits(previous: NDArray[np.float32], grid: HeightGrid, classes: int) -> Tensor:
    """Log-probabilities (V * V, C) of an earlier map's (C, V, V).

    Raises:
        InputError: another shape, or not finite.
    """
    expected = (classes, *grid.shape)
    if previous.shape != expected:
        raise InputError(
            f"probabilities of the earlier map have shape {previous.shape}, expected {expected}; "
            "resume with the grid and the classes that it was saved with"
        )
    if not np.isfinite(previous).all():
        raise InputError("probabilities of the earlier map are not all finite; fuse it again")
    values = torch.from_numpy(np.asarray(previous, dtype=np.float32)).flatten(1)
    logits = values.clamp(min=_LEAST).log()
    return (logits - logits.mean(dim=0)).T.contiguous()


def restored_logits(state: State, shape: Sequence[int]) -> Tensor:
    """The sums of a state.

    Raises:
        InputError: they are of another grid or other classes, missing or not finite.
    """
    logits = np.asarray(state.get("logits", ()), dtype=np.float32)
    if logits.shape != tuple(shape):
        raise InputError(
            f"state of a label fusion has logits of shape {logits.shape}, expected {tuple(shape)}; "
            "resume with the grid, the classes and the method that it was saved with"
        )
    if not np.isfinite(logits).all():
        raise InputError("logits of the state of a label fusion are not all finite; fuse it again")
    return torch.from_numpy(logits)
