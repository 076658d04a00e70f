"""What rays pass of unions of convex solids: one ray per pixel, as intervals of z-depth.

A ray is o + t d with d = 1 along the optical axis, so that t is z-depth. Each solid is given by its
planes and by a ball about it, which spares most rays the planes.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numba import prange
from torch import Tensor

from scenefw.core.batches import CameraBatch
from scenefw.kernels.compile import Kernel, element, loop
from scenefw_things.shells.batches import Shells

FAR = np.float32(1e9)
_ZERO = np.float32(0)
_PARALLEL = np.float32(1e-9)
_SAME = np.float32(2e-5)  # m: intervals so near to one another are one
_INTERVALS = 6  # of a ray; of further ones only the ends count


class PartPlanes(NamedTuple):
    """Convex parts of N solids.

    Args:
        solids: (N, 2) int32, first and one after the last part of each.
        ends: (P + 1,) int32, the planes of part p are those from ends[p] to ends[p + 1].
        balls: (P, 4) centre and radius of a ball about each part (m).
        planes: (K, 4) of points x with planes[:, :3] @ x + planes[:, 3] <= 0 inside.
    """

    solids: Tensor
    ends: Tensor
    balls: Tensor
    planes: Tensor


@element
def _misses_ball(balls, part, ox, oy, oz, dx, dy, dz):
    x, y, z = balls[part, 0] - ox, balls[part, 1] - oy, balls[part, 2] - oz
    along, length = x * dx + y * dy + z * dz, dx * dx + dy * dy + dz * dz
    return x * x + y * y + z * z - along * along / length > balls[part, 3] * balls[part, 3]


@element
def _add(intervals, i, near, far):
    """Joins an interval with those of a ray, which are in order and apart, up to one at FAR."""
    count = 0
    for j in range(_INTERVALS):
        start, end = intervals[i, j, 0], intervals[i, j, 1]
        if start >= FAR:
            break
        if end + _SAME < near or start > far + _SAME:
            intervals[i, count, 0], intervals[i, count, 1] = start, end
            count += 1
        else:
            near, far = min(near, start), max(far, end)
    if count == _INTERVALS:
        intervals[i, 0, 0] = min(intervals[i, 0, 0], near)
        intervals[i, count - 1, 1] = max(intervals[i, count - 1, 1], far)
        return
    j = count
    while j > 0 and intervals[i, j - 1, 0] > near:
        intervals[i, j, 0], intervals[i, j, 1] = intervals[i, j - 1, 0], intervals[i, j - 1, 1]
        j -= 1
    intervals[i, j, 0], intervals[i, j, 1] = near, far
    if count + 1 < _INTERVALS:
        intervals[i, count + 1, 0] = FAR


@element
def _describe(intervals, i, min_gap, depths, amodal, hollow):
    """Ends of a ray's intervals, and the widest gap between them."""
    if intervals[i, 0, 0] >= FAR:
        return
    amodal[i], widest = True, min_gap
    depths[i, 0], depths[i, 1] = intervals[i, 0, 0], intervals[i, 0, 1]
    for j in range(1, _INTERVALS):
        start, end = intervals[i, j - 1, 1], intervals[i, j, 0]
        if end >= FAR:
            break
        depths[i, 1] = intervals[i, j, 1]
        if end - start > widest:
            hollow[i], widest = True, end - start
            depths[i, 2], depths[i, 3] = start, end


@element
def _pass(i, pixels, width, min_gap, intrinsics, frames, solids, ends, balls, planes, intervals,
          depths, amodal, hollow):  # fmt: skip
    n, p = i // pixels, i % pixels
    v, u = p // width, p % width
    x = (np.float32(u) - intrinsics[n, 2]) / intrinsics[n, 0]
    y = (np.float32(v) - intrinsics[n, 3]) / intrinsics[n, 1]
    ox, oy, oz = frames[n, 0, 3], frames[n, 1, 3], frames[n, 2, 3]
    dx = frames[n, 0, 0] * x + frames[n, 0, 1] * y + frames[n, 0, 2]
    dy = frames[n, 1, 0] * x + frames[n, 1, 1] * y + frames[n, 1, 2]
    dz = frames[n, 2, 0] * x + frames[n, 2, 1] * y + frames[n, 2, 2]
    intervals[i, 0, 0] = FAR
    for part in range(solids[n, 0], solids[n, 1]):
        if _misses_ball(balls, part, ox, oy, oz, dx, dy, dz):
            continue
        near, far = _ZERO, FAR
        for k in range(ends[part], ends[part + 1]):
            height = planes[k, 0] * ox + planes[k, 1] * oy + planes[k, 2] * oz + planes[k, 3]
            slope = planes[k, 0] * dx + planes[k, 1] * dy + planes[k, 2] * dz
            if abs(slope) < _PARALLEL:
                if height > _ZERO:
                    far = -FAR
            elif slope < _ZERO:
                near = max(near, -height / slope)
            else:
                far = min(far, -height / slope)
            if near >= far:
                break
        if near < far:
            _add(intervals, i, near, far)
    _describe(intervals, i, min_gap, depths, amodal, hollow)


@loop
def _pass_all(count, pixels, width, min_gap, intrinsics, frames, solids, ends, balls, planes,
              intervals, depths, amodal, hollow):  # fmt: skip
    for i in prange(count):
        _pass(np.int64(i), pixels, width, min_gap, intrinsics, frames, solids, ends, balls, planes,
              intervals, depths, amodal, hollow)  # fmt: skip


_pass_kernel = Kernel(_pass, _pass_all)


def shells(cameras: CameraBatch, frames: Tensor, parts: PartPlanes, min_gap: float) -> Shells:
    """Shells of N solids, each seen by a camera of its own.

    Args:
        cameras: N, of which only intrinsics count.
        frames: (N, 3, 4) affine maps from each camera's frame to that of its solid.
        parts: of the solids.
        min_gap: narrower gaps along a ray are none (m).
    """
    width, height, device = cameras.width, cameras.height, frames.device
    count = len(frames) * width * height
    depths = torch.zeros(count, 4, device=device)
    amodal, hollow = torch.zeros(2, count, dtype=torch.bool, device=device).unbind()
    intervals = torch.empty(count, _INTERVALS, 2, device=device)
    inputs = [cameras.intrinsics.float(), frames.float(), *parts]
    _pass_kernel(count, width * height, width, np.float32(min_gap),
                 *(values.contiguous() for values in inputs),
                 intervals, depths, amodal, hollow)  # fmt: skip
    shape = (len(frames), height, width)
    layers = depths.view(*shape, 4).permute(0, 3, 1, 2).contiguous()
    return Shells(layers, amodal.view(shape), hollow.view(shape))
