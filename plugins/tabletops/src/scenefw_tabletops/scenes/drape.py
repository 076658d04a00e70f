"""Limp things, such as cables, over a relief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenefw_tabletops.scenes.resting import Relief

Array = NDArray[np.float64]

_STEEPEST = 0.9  # rise by run
_HIGHEST = 0.05  # m
_PLUG = 0.035  # m: ends stay this far from what is higher


@dataclass(frozen=True, eq=False)
class Draped:
    """Heights (S,) of the points of a spine over where they were, and points (P, 3) of its top."""

    lifts: Array
    top: Array


def draped(spine: Array, relief: Relief) -> Draped | None:
    """A spine (S, 3) at rest over the table, laid over a relief; None where it finds no place."""
    radius = float(spine[0, 2])
    ahead = np.gradient(spine[:, :2], axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    side = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    ends = np.concatenate(
        [spine[0, :2] - ahead[0] * np.linspace(0, _PLUG, 12)[:, None],
         spine[-1, :2] + ahead[-1] * np.linspace(0, _PLUG, 12)[:, None]]
    )  # fmt: skip
    wide = np.linspace(-1, 1, 5)[:, None, None] * radius
    across = spine[None, :, :2] + wide * side
    if not relief.inside(across.reshape(-1, 2)) or not relief.inside(ends):
        return None
    steps = np.linalg.norm(np.diff(spine[:, :2], axis=0), axis=1)
    lifts = _hung(relief.at(across).max(axis=0), np.concatenate([[0], np.cumsum(steps)]))
    before, after = np.split(relief.at(ends), 2)
    if lifts.max() > _HIGHEST or before.max() > lifts[0] + 1e-3 or after.max() > lifts[-1] + 1e-3:
        return None
    points = np.dstack([across, np.broadcast_to(lifts + 2 * radius, across.shape[:2])])
    between = (points[:, 1:] + points[:, :-1]) / 2
    return Draped(lifts, np.concatenate([points.reshape(-1, 3), between.reshape(-1, 3)]))


def _hung(under: Array, along: Array) -> Array:
    """The lowest line over heights (S,) that is nowhere too steep, its bends rounded."""
    distances = np.abs(along[:, None] - along)
    line = (under - _STEEPEST * distances).max(axis=1)
    padded = np.pad(line, 2, mode="edge")
    mean = np.mean([padded[k : k + len(line)] for k in range(5)], axis=0)
    return np.asarray(np.maximum(mean, line))
