"""Rays through triangles: a tree of boxes walked without a stack, one ray per element.

`bounds` (B, 6) float32 holds lowest and highest corners of boxes in the order of a walk down the
tree; `links` (B, 3) int32 the box to go on with when a box is missed, and the first triangle and
the number of triangles of a leaf (0 = inner box, go on with the next one). `triangles` (F, 9)
float32 are a corner and the two sides from it, in the order of the leaves. `rays` (R, 6) float32
are origins and directions; distances count in lengths of the direction.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

from __future__ import annotations

import numpy as np
import torch
from numba import njit, prange
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.kernels.cameras import pixel_places
from scenefw.kernels.compile import Kernel, declare, element, loop
from scenefw.kernels.mesh_distances import FARTHEST, approach

ZERO = np.float32(0)
ONE = np.float32(1)
FAR = np.float32(1e30)
_TINY = np.float32(1e-30)
_EDGE = np.float32(-1e-6)  # so that no ray slips between neighbours
_LEAF = 4
_BINS = 12
BLOCK = 128
"""Rays that a CPU thread takes at a time."""
LANES = 64
"""Interleaved, so that threads share costly and cheap parts of an image evenly."""

NOTHING, TABLE = -2, -1
"""Hits that are no triangle."""


@element
def _inverse(x):
    if abs(x) < _TINY:
        return FAR if x >= ZERO else -FAR
    return ONE / x


@element
def _meets(bounds, node, ox, oy, oz, ix, iy, iz, limit):
    """Whether a ray enters a box before `limit`."""
    ax, bx = (bounds[node, 0] - ox) * ix, (bounds[node, 3] - ox) * ix
    ay, by = (bounds[node, 1] - oy) * iy, (bounds[node, 4] - oy) * iy
    az, bz = (bounds[node, 2] - oz) * iz, (bounds[node, 5] - oz) * iz
    enter = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), ZERO))
    leave = min(min(max(ax, bx), max(ay, by)), min(max(az, bz), limit))
    return enter <= leave


@element
def _intersect(triangles, k, ox, oy, oz, dx, dy, dz):
    """Distance and barycentric coordinates where a ray meets a triangle (Moeller, Trumbore 1997).

    The distance is negative where it does not.
    """
    ax, ay, az = triangles[k, 3], triangles[k, 4], triangles[k, 5]
    bx, by, bz = triangles[k, 6], triangles[k, 7], triangles[k, 8]
    px, py, pz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    determinant = ax * px + ay * py + az * pz
    if abs(determinant) < _TINY:
        return -ONE, ZERO, ZERO
    scale = ONE / determinant
    sx, sy, sz = ox - triangles[k, 0], oy - triangles[k, 1], oz - triangles[k, 2]
    u = (sx * px + sy * py + sz * pz) * scale
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    v = (dx * qx + dy * qy + dz * qz) * scale
    if u < _EDGE or v < _EDGE or u + v > ONE - _EDGE:
        return -ONE, ZERO, ZERO
    return (bx * qx + by * qy + bz * qz) * scale, u, v


@element
def nearest(bounds, links, triangles, node, last, ox, oy, oz, dx, dy, dz, limit):
    """Nearest triangle before `limit`, or NOTHING; distance; barycentric coordinates.

    Boxes `node` to `last` - 1 are the tree.
    """
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    hit, best_u, best_v = NOTHING, ZERO, ZERO
    while node < last:
        if not _meets(bounds, node, ox, oy, oz, ix, iy, iz, limit):
            node = links[node, 0]
            continue
        first = links[node, 1]
        for k in range(first, first + links[node, 2]):
            t, u, v = _intersect(triangles, k, ox, oy, oz, dx, dy, dz)
            if t > ZERO and t < limit:
                limit, hit, best_u, best_v = t, k, u, v
        node += 1
    return hit, limit, best_u, best_v


@element
def blocked(bounds, links, triangles, node, last, ox, oy, oz, dx, dy, dz, limit):
    """Whether any triangle lies on a ray before `limit`."""
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    while node < last:
        if not _meets(bounds, node, ox, oy, oz, ix, iy, iz, limit):
            node = links[node, 0]
            continue
        first = links[node, 1]
        for k in range(first, first + links[node, 2]):
            t, _, _ = _intersect(triangles, k, ox, oy, oz, dx, dy, dz)
            if t > ZERO and t < limit:
                return True
        node += 1
    return False


@element
def first_hit(bounds, links, triangles, node, last, table, ox, oy, oz, dx, dy, dz):
    """Triangle, TABLE or NOTHING; distance, 0 at NOTHING; barycentric coordinates."""
    limit, ground = FAR, NOTHING
    if table and oz * dz < ZERO:
        limit, ground = -oz / dz, TABLE
    face, t, u, v = nearest(bounds, links, triangles, node, last, ox, oy, oz, dx, dy, dz, limit)
    if face == NOTHING:
        face = ground
    return face, t if face != NOTHING else ZERO, u, v


@element
def _cast(i, bounds, links, triangles, rays, table, distance, hit, place):
    ox, oy, oz = rays[i, 0], rays[i, 1], rays[i, 2]
    dx, dy, dz = rays[i, 3], rays[i, 4], rays[i, 5]
    hit[i], distance[i], place[i, 0], place[i, 1] = first_hit(
        bounds, links, triangles, 0, len(links), table, ox, oy, oz, dx, dy, dz
    )


@loop
def _cast_all(count, bounds, links, triangles, rays, table, distance, hit, place):
    for lane in prange(LANES):
        for start in range(np.int64(lane) * BLOCK, count, LANES * BLOCK):
            for i in range(start, min(start + BLOCK, count)):
                _cast(i, bounds, links, triangles, rays, table, distance, hit, place)


cast = Kernel(
    _cast,
    _cast_all,
    min_shared=4096,  # rays take about a microsecond each
    types="i8, f4[:, ::1], i4[:, ::1], f4[:, ::1], f4[:, ::1], b1, f4[::1], i4[::1], f4[:, ::1]",
)
"""cast(R, bounds, links, triangles, rays, table, distance (R,), hit (R,) int32, place (R, 2)).

`hit` is a row of `triangles`, TABLE (the plane z = 0, if `table`) or NOTHING, where distance is 0.
"""


def build_tree(corners: NDArray[np.float32]) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Bounds, links, triangles, and their order (F,) int64 among the corners (F, 3, 3), metres."""
    corners = np.ascontiguousarray(corners, dtype=np.float32)
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    low = np.minimum(np.minimum(first, second), third)
    high = np.maximum(np.maximum(first, second), third)
    bounds, links, order = _build(low, high) if len(corners) else _empty()
    picked = corners[order]
    sides = picked[:, 1:] - picked[:, :1]
    triangles = np.concatenate([picked[:, :1], sides], axis=1).reshape(-1, 9)
    return bounds, links, triangles, order


class Tree:
    """Triangles sorted into boxes, as tensors that kernels read.

    Args:
        corners: (F, 3, 3) metres.
        device: where the rays are.

    Attributes:
        order: (F,) int64, row of `corners` of each row of `triangles`.
    """

    def __init__(self, corners: NDArray[np.float32], device: torch.device | str = "cpu") -> None:
        *arrays, self.order = build_tree(corners)
        self.bounds, self.links, self.triangles = (torch.from_numpy(a).to(device) for a in arrays)

    def cast(self, rays: Tensor, *, table: bool = True) -> tuple[Tensor, Tensor, Tensor]:
        """Distances (R,), hits (R,) int32 and barycentric places (R, 2) of rays (R, 6)."""
        count = len(rays)
        distance = rays.new_empty(count)
        hit = torch.empty(count, dtype=torch.int32, device=rays.device)
        place = rays.new_empty(count, 2)
        cast(count, self.bounds, self.links, self.triangles, rays, table, distance, hit, place)
        return distance, hit, place

    def distances(self, places: Tensor, limit: float) -> Tensor:
        """Distances (P,) of places (P, 3) to the nearest triangle (m), at most `limit`."""
        distance = places.new_empty(len(places))
        nearest_limit = np.float32(min(limit, FARTHEST))
        tree = self.bounds, self.links, self.triangles
        approach(len(places), *tree, places, nearest_limit, distance)
        return distance

    def depth(self, cameras: CameraBatch, *, table: bool = True) -> Tensor:
        """Z-depth (B, H, W) in metres that cameras see; 0 = nothing hit.

        Args:
            cameras: on the device of the triangles.
            table: the plane z = 0 is seen too.
        """
        count = len(cameras.intrinsics)
        shape = (count, cameras.height, cameras.width)
        unit_depth = torch.ones(shape, device=self.triangles.device)
        eyes = cameras.T_world_camera[:, None, None, :3, 3].expand(*shape, 3)
        rays = torch.cat([eyes, pixel_places(unit_depth, cameras) - eyes], dim=-1)
        return self.cast(rays.view(-1, 6).contiguous(), table=table)[0].view(shape)


def _empty() -> tuple[NDArray, NDArray, NDArray]:
    bounds = np.full((1, 6), 1e9, dtype=np.float32)
    return bounds, np.array([[1, 0, 0]], dtype=np.int32), np.zeros(0, dtype=np.int64)


# By elements alone: numba compiles assignments of rows and slices, and maxima, for seconds


@njit(cache=True)
def _build(low, high):
    """Boxes in walking order, links and the order of triangles (surface area heuristic)."""
    count = len(low)
    order, centres = np.empty(count, dtype=np.int64), np.empty((count, 3), dtype=np.float32)
    for k in range(count):
        order[k] = k
        for axis in range(3):
            centres[k, axis] = (low[k, axis] + high[k, axis]) * np.float32(0.5)
    bounds = np.empty((2 * count, 6), dtype=np.float32)
    links = np.empty((2 * count, 3), dtype=np.int32)
    depths = np.empty(2 * count, dtype=np.int64)
    waiting = np.empty((count + 2, 3), dtype=np.int64)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, count, 0
    stacked, nodes = 1, 0
    while stacked > 0:
        stacked -= 1
        first, end, depth = waiting[stacked, 0], waiting[stacked, 1], waiting[stacked, 2]
        _surround(low, high, order, first, end, bounds[nodes])
        depths[nodes] = depth
        middle = first
        if end - first > _LEAF:
            middle = _split(low, high, centres, order, first, end)
        links[nodes, 1], links[nodes, 2] = first, end - first if middle == first else 0
        if middle > first:  # the higher half first, as cameras look down
            upper = _top(high, order, first, middle) >= _top(high, order, middle, end)
            for half in range(2):
                is_first = (half == 1) == upper
                waiting[stacked, 0] = first if is_first else middle
                waiting[stacked, 1] = middle if is_first else end
                waiting[stacked, 2] = depth + 1
                stacked += 1
        nodes += 1
    _link(links, depths, nodes)
    return bounds[:nodes], links[:nodes], order


@njit(cache=True)
def _surround(low, high, order, first, end, box):
    _clear(box)
    for k in range(first, end):
        for axis in range(3):
            box[axis] = min(box[axis], low[order[k], axis])
            box[3 + axis] = max(box[3 + axis], high[order[k], axis])


@njit(cache=True)
def _clear(box):
    """A box that holds nothing."""
    for axis in range(3):
        box[axis], box[3 + axis] = np.inf, -np.inf


@njit(cache=True)
def _top(high, order, first, end):
    top = high[order[first], 2]
    for k in range(first, end):
        top = max(top, high[order[k], 2])
    return top


@njit(cache=True)
def _split(low, high, centres, order, first, end):
    """Sorts triangles into two halves along the longest axis; where the second one begins."""
    box = np.empty(6)
    _surround(centres, centres, order, first, end, box)
    axis = int(box[4] - box[1] > box[3] - box[0])
    if box[5] - box[2] > box[3 + axis] - box[axis]:
        axis = 2
    minimum, width = box[axis], box[3 + axis] - box[axis]
    if width <= 0:
        return first
    counts, areas = _bin(low, high, centres, order, first, end, axis, minimum, width)
    best, split_bin = np.inf, 0
    for place in range(1, _BINS):
        if counts[0, place] > 0 and counts[1, place] > 0:
            cost = counts[0, place] * areas[0, place] + counts[1, place] * areas[1, place]
            if cost < best:
                best, split_bin = cost, place
    left, right = first, end - 1
    while left <= right:
        if _bin_of(centres[order[left], axis], minimum, width) < split_bin:
            left += 1
        else:
            order[left], order[right] = order[right], order[left]
            right -= 1
    return left


@njit(cache=True)
def _bin_of(value, minimum, width):
    return min(_BINS - 1, int((value - minimum) / width * _BINS))


@njit(cache=True)
def _bin(low, high, centres, order, first, end, axis, minimum, width):
    """Numbers of triangles and areas of their boxes, left and right of each cut."""
    boxes, bin_counts = np.empty((_BINS, 6)), np.zeros(_BINS)
    for b in range(_BINS):
        _clear(boxes[b])
    for k in range(first, end):
        i = order[k]
        b = _bin_of(centres[i, axis], minimum, width)
        bin_counts[b] += 1
        for a in range(3):
            boxes[b, a] = min(boxes[b, a], low[i, a])
            boxes[b, 3 + a] = max(boxes[b, 3 + a], high[i, a])
    counts, areas, box = np.zeros((2, _BINS)), np.zeros((2, _BINS)), np.empty(6)
    for side in range(2):
        total = 0.0
        _clear(box)
        for step in range(_BINS - 1):
            b = step if side == 0 else _BINS - 1 - step
            total += bin_counts[b]
            for a in range(3):
                box[a] = min(box[a], boxes[b, a])
                box[3 + a] = max(box[3 + a], boxes[b, 3 + a])
            split_bin = b + 1 if side == 0 else b
            counts[side, split_bin] = total
            x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
            areas[side, split_bin] = x * y + y * z + z * x if total > 0 else 0.0
    return counts, areas


@njit(cache=True)
def _link(links, depths, count):
    """Where to go on when a box is missed: the next one in the walk that is not inside it."""
    deepest = 0
    for node in range(count):
        deepest = max(deepest, depths[node])
    following = np.empty(deepest + 1, dtype=np.int64)
    for depth in range(deepest + 1):
        following[depth] = count
    for node in range(count - 1, -1, -1):
        links[node, 0] = following[depths[node]]
        for depth in range(depths[node], deepest + 1):
            following[depth] = node


declare(_build, "f4[:, ::1], f4[:, ::1]")
