"""The baseline without learning: everything above the floor, cut at depth jumps."""

from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from scenefw.core.types import Float32, Frame, Int32
from scenefw.perception.points import world_points


class DepthComponents:
    """Segments a depth image by removing the floor and joining neighbours of similar depth.

    Args:
        margin: pixels up to this height above the floor belong to it (m).
        jump: neighbouring pixels further apart in depth belong to different objects (m).
        smallest: components of fewer pixels are dropped.
    """

    def __init__(self, margin: float = 0.005, jump: float = 0.012, smallest: int = 500) -> None:
        self.margin = margin
        self.jump = jump
        self.smallest = smallest

    def with_margin(self, margin: float) -> Self:
        """The same at another margin (m)."""
        return type(self)(margin, self.jump, self.smallest)

    def segment(self, frame: Frame) -> Int32:
        """Labels (H, W), 0 = no object, of a frame whose camera has its pose (floor z = 0)."""
        above = world_points(frame)[..., 2] > self.margin  # NaN where no depth: not above
        components = _join(frame.depth, above, self.jump)
        sizes = np.bincount(components.ravel())
        kept = sizes >= self.smallest
        kept[0] = False  # label 0 is the background
        return (np.cumsum(kept) * kept)[components].astype(np.int32)


def _join(depth: Float32, above: NDArray[np.bool_], jump: float) -> NDArray[np.int64]:
    """Components (H, W), from 1 on, of pixels `above`; neighbours of similar depth join."""
    index = np.arange(depth.size).reshape(depth.shape)
    rows, columns = [], []
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        joined = above[a] & above[b] & (np.abs(depth[a] - depth[b]) < jump)
        rows.append(index[a][joined])
        columns.append(index[b][joined])
    row, column = np.concatenate(rows), np.concatenate(columns)
    links = coo_matrix((np.ones(len(row), bool), (row, column)), (depth.size, depth.size))
    labels = connected_components(links, directed=False)[1].reshape(depth.shape)
    used = np.unique(labels[above])
    return np.where(above, np.searchsorted(used, labels) + 1, 0)
