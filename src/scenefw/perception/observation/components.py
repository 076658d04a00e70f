"""Connected components of a depth image: neighbouring pixels of similar depth belong together."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from scenefw.core.types import Float32

EDGE = 0.03
"""m: where depth jumps as far from one pixel to the next, another object begins.

A cube with shorter sides is a fragment of one.
"""

NOISE = 0.002
"""m of depth between neighbouring pixels, or of height of a floor, that say nothing: one sigma."""

DETAIL = 0.005
"""m: what is smaller, shapes don't show."""

TOUCH = 0.012
"""m: surfaces that come as near may touch, neighbouring pixels be of one surface."""

Slices = tuple[slice, ...]


def neighbours() -> tuple[tuple[Slices, Slices], tuple[Slices, Slices]]:
    """Slices of an image and of what lies on the right, and below."""
    every, first, second = slice(None), slice(None, -1), slice(1, None)
    return ((every, first), (every, second)), ((first,), (second,))


def depth_parts(depth: Float32, mask: NDArray[np.bool_], jump: float) -> NDArray[np.int64]:
    """Components (H, W), from 1 on, of the pixels of `mask`; 0 elsewhere.

    Args:
        depth: (H, W) metres.
        mask: (H, W) pixels that belong to a part.
        jump: neighbouring pixels further apart in depth belong to different parts (m).
    """
    count = int(mask.sum())
    index = np.zeros(mask.shape, np.int32)
    index[mask] = np.arange(count)
    rows, columns = [], []
    for a, b in neighbours():
        link_mask = mask[a] & mask[b] & (np.abs(depth[a] - depth[b]) < jump)
        rows.append(index[a][link_mask])
        columns.append(index[b][link_mask])
    row, column = np.concatenate(rows), np.concatenate(columns)
    links = coo_matrix((np.ones(len(row), bool), (row, column)), (count, count))
    labels = np.zeros(mask.shape, np.int64)
    labels[mask] = connected_components(links, directed=False)[1] + 1 if count else 0
    return labels


def across_gaps(
    depth: Float32, mask: NDArray[np.bool_], max_gap: int
) -> tuple[Float32, NDArray[np.bool_]]:
    """Depth (H, W; m) and a mask, each pixel without depth with those of the nearest one that has.

    Args:
        depth: (H, W) metres, 0 = no measurement.
        mask: (H, W).
        max_gap: pixels farther from all others stay without depth.
    """
    distance, nearest = distance_transform_edt(depth == 0, return_indices=True)
    rows, columns = nearest
    is_close = distance <= max_gap
    return np.where(is_close, depth[rows, columns], 0), is_close & mask[rows, columns]
