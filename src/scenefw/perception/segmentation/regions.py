"""Parts of a depth image: neighbouring pixels of similar depth belong together."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from scenefw.core.types import Float32, Float64, Frame, Int32
from scenefw.perception.observation.components import EDGE, NOISE, neighbours
from scenefw.perception.observation.points import camera_points


def hiding(parts: Int32, depth: Float32, share: float = 0.9) -> NDArray[np.bool_]:
    """Which parts (P + 1, P + 1) border on each other where one hides the other.

    No convex object has such borders between two parts of its own.

    Args:
        parts: (H, W), 0 = none.
        depth: (H, W) metres.
        share: of a border's pixels at which depth must jump (`EDGE`).
    """
    across, down = (np.abs(depth[a] - depth[b]) > EDGE for a, b in neighbours())
    jumps, borders = along_borders(parts, across, down)
    occlusions: NDArray[np.bool_] = (borders > 0) & (jumps >= share * borders)
    return occlusions


def along_borders(
    parts: NDArray[np.integer[Any]], across: NDArray[Any], down: NDArray[Any]
) -> tuple[Float64, Float64]:
    """Sums of values along the borders between parts, and the lengths of these borders (pixels).

    Args:
        parts: (H, W), 0 = none.
        across: (H, W - 1) values between a pixel and its right neighbour.
        down: (H - 1, W) the same for the one below.

    Returns:
        Two tables (P + 1, P + 1), symmetric.
    """
    count = int(parts.max(initial=0)) + 1
    sums, lengths = np.zeros((2, count, count))
    values = iter((across, down))
    for a, b in neighbours():
        value, first, second = next(values), parts[a], parts[b]
        on_border = (first != second) & (first > 0) & (second > 0)
        for rows, columns in ((first, second), (second, first)):
            np.add.at(sums, (rows[on_border], columns[on_border]), value[on_border])
            np.add.at(lengths, (rows[on_border], columns[on_border]), 1)
    return sums, lengths


def large_parts(components: NDArray[np.int64], min_pixels: int) -> NDArray[np.int32]:
    """Components (H, W) of at least `min_pixels` pixels, renumbered from 1 on; others become 0."""
    sizes = np.bincount(components.ravel())
    keep_mask = sizes >= min_pixels
    keep_mask[0] = False  # label 0 is the background
    return (np.cumsum(keep_mask) * keep_mask)[components].astype(np.int32)


def concave_creases(frame: Frame, cosine: float, reach: int) -> NDArray[np.bool_]:
    """Pixels (H, W) at which the seen surface bends towards the camera, along rows or columns.

    Three points of a row or a column, `reach` pixels apart, say how much: the middle one lies
    behind the chord of the others, and the directions to and from it differ.

    Args:
        frame: its depth counts, in camera coordinates.
        cosine: of the least angle between these directions.
        reach: pixels.
    """
    points = camera_points(frame)
    creases = np.zeros(frame.depth.shape, dtype=bool)
    for axis in (0, 1):
        if creases.shape[axis] <= 2 * reach:
            continue
        before, centre, after = _thirds(points, axis, reach)
        incoming, outgoing = centre - before, after - centre
        with np.errstate(invalid="ignore"):
            is_bent = _dot(incoming, outgoing) < cosine * np.sqrt(
                _dot(incoming, incoming) * _dot(outgoing, outgoing)
            )
            # centre: also the direction of its ray
            is_behind = _dot(incoming - outgoing, centre) > 0
        middle = [slice(None), slice(None)]
        middle[axis] = slice(reach, -reach)
        creases[tuple(middle)] |= is_bent & is_behind
    return creases


def _thirds(points: Float64, axis: int, reach: int) -> tuple[Float64, Float64, Float64]:
    """The points that have neighbours at `reach` on both sides of an axis, between these."""
    size = points.shape[axis]
    starts = ((0, size - 2 * reach), (reach, size - reach), (2 * reach, size))
    spans = [points[start:stop] if axis == 0 else points[:, start:stop] for start, stop in starts]
    return spans[0], spans[1], spans[2]


def _dot(a: Float64, b: Float64) -> Float64:
    return np.einsum("...i,...i->...", a, b)


def grown(
    labels: Int32, mask: NDArray[np.bool_], depth: Float32, max_step: float = np.inf
) -> Int32:
    """Labels (H, W) that also cover the pixels of `mask` that can be reached through others.

    Each takes the label that is nearest along the image, where a step costs a pixel and each
    millimetre of depth beyond `NOISE` another (Dijkstra's shortest paths from all labels at once).

    Args:
        labels: (H, W), 0 = none.
        mask: (H, W) pixels that may get one.
        depth: (H, W) metres.
        max_step: no step goes across a jump of depth above this (m).
    """
    unlabelled = mask & (labels == 0)
    seeds = (labels > 0) & binary_dilation(unlabelled)
    if not unlabelled.any() or not seeds.any():
        return labels
    number = np.cumsum((unlabelled | seeds).ravel()).reshape(labels.shape) - 1
    steps = _steps(depth, unlabelled | seeds, number, max_step)
    _, _, source = dijkstra(
        steps, directed=False, indices=number[seeds], return_predecessors=True, min_only=True
    )
    node_labels = labels[unlabelled | seeds]
    filled = labels.copy()
    filled[unlabelled | seeds] = np.where(
        source >= 0, node_labels[np.maximum(source, 0)], node_labels
    )
    return filled


def _steps(
    depth: Float32, mask: NDArray[np.bool_], number: NDArray[np.intp], max_step: float
) -> csr_matrix:
    """Costs between neighbours, by their numbers."""
    rows, columns, costs = [], [], []
    for a, b in neighbours():
        link_mask = mask[a] & mask[b] & (np.abs(depth[a] - depth[b]) <= max_step)
        rise = np.abs(depth[a][link_mask] - depth[b][link_mask])
        rows.append(number[a][link_mask])
        columns.append(number[b][link_mask])
        costs.append(1 + 1000 * np.maximum(rise - NOISE, 0))
    size = int(mask.sum())
    indices = (np.concatenate(rows), np.concatenate(columns))
    return csr_matrix((np.concatenate(costs), indices), (size, size))
