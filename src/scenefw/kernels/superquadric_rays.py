"""Which superquadric a ray meets first: one ray per pixel, without a volume.

A ray is cut to the box about an object. There eq. 5.1 minus one, as a function of the way along
the ray, is convex and at most 2; Newton from the near end is monotone, as it never passes a root.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
import torch
from numba import prange
from torch import Tensor

from scenefw.core.batches import CameraBatch, SceneParameters
from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.elementary import exp, log

_ZERO = np.float32(0)
_ONE = np.float32(1)
_NEAR = np.float32(1e-9)
_FAR = np.float32(1e9)
_SMALL = np.float32(1e-3)
_STEPS = 24


@element
def _slab(o, d, near, far):
    """The part of a ray o + t d with |o + t d| <= 1, in what is left of it."""
    if abs(d) < _NEAR:
        return (near, far) if abs(o) <= _ONE else (_FAR, -_FAR)
    a, b = (-_ONE - o) / d, (_ONE - o) / d
    return max(near, min(a, b)), min(far, max(a, b))


@element
def _term(o, d, t, r):
    """|o + t d|^r and its derivative by t."""
    u = o + t * d
    size = max(abs(u), _NEAR)
    power = exp(r * log(size))
    slope = r * power / size * d
    return power, slope if u >= _ZERO else -slope


@element
def _hit(ox, oy, oz, dx, dy, dz, rx, ry, rz):
    """Where a ray meets the surface, in units of its direction; `_FAR` if it doesn't."""
    near, far = _slab(ox, dx, _ZERO, _FAR)
    near, far = _slab(oy, dy, near, far)
    near, far = _slab(oz, dz, near, far)
    if near >= far:
        return _FAR
    t = near
    for _ in range(_STEPS):
        vx, sx = _term(ox, dx, t, rx)
        vy, sy = _term(oy, dy, t, ry)
        vz, sz = _term(oz, dz, t, rz)
        above, slope = vx + vy + vz - _ONE, sx + sy + sz
        if above < _SMALL:
            return t
        if slope >= _ZERO:
            return _FAR
        t -= above / slope
        if t > far:
            return _FAR
    return t


@element
def _along(rotations, b, k, axis, x, y, z):
    """A direction of the world along an axis of an object."""
    first, second = rotations[b, k, 0, axis] * x, rotations[b, k, 1, axis] * y
    return first + second + rotations[b, k, 2, axis] * z


@element
def _see(i, pixels, width, objects, intrinsics, poses, axes, exponents, rotations, positions,
         present, depth, owners):  # fmt: skip
    b, p = i // pixels, i % pixels
    v, u = p // width, p % width
    x = (np.float32(u) - intrinsics[b, 2]) / intrinsics[b, 0]
    y = (np.float32(v) - intrinsics[b, 3]) / intrinsics[b, 1]
    wx = poses[b, 0, 0] * x + poses[b, 0, 1] * y + poses[b, 0, 2]
    wy = poses[b, 1, 0] * x + poses[b, 1, 1] * y + poses[b, 1, 2]
    wz = poses[b, 2, 0] * x + poses[b, 2, 1] * y + poses[b, 2, 2]
    best, owner = _FAR, 0
    for k in range(objects):
        if not present[b, k]:
            continue
        cx = poses[b, 0, 3] - positions[b, k, 0]
        cy = poses[b, 1, 3] - positions[b, k, 1]
        cz = poses[b, 2, 3] - positions[b, k, 2]
        ax, ay, az = axes[b, k, 0], axes[b, k, 1], axes[b, k, 2]
        ox = _along(rotations, b, k, 0, cx, cy, cz) / ax
        oy = _along(rotations, b, k, 1, cx, cy, cz) / ay
        oz = _along(rotations, b, k, 2, cx, cy, cz) / az
        dx = _along(rotations, b, k, 0, wx, wy, wz) / ax
        dy = _along(rotations, b, k, 1, wx, wy, wz) / ay
        dz = _along(rotations, b, k, 2, wx, wy, wz) / az
        rx, ry, rz = exponents[b, k, 0], exponents[b, k, 1], exponents[b, k, 2]
        t = _hit(ox, oy, oz, dx, dy, dz, rx, ry, rz)
        if t < best:
            best, owner = t, k + 1
    depth[i] = best if owner else _ZERO
    owners[i] = owner


@loop
def _see_all(count, pixels, width, objects, intrinsics, poses, axes, exponents, rotations,
             positions, present, depth, owners):  # fmt: skip
    for i in prange(count):
        _see(i, pixels, width, objects, intrinsics, poses, axes, exponents, rotations, positions,
             present, depth, owners)  # fmt: skip


_seen = Kernel(_see, _see_all)


def first_hits(scenes: SceneParameters, cameras: CameraBatch) -> tuple[Tensor, Tensor]:
    """What cameras see of superquadrics, without the floor.

    Args:
        scenes: B of up to N superquadrics.
        cameras: one for each.

    Returns:
        z-depth (B, H, W) in metres, 0 = nothing, and which object (B, H, W) int32 it is of,
        0 = none, i + 1 = object i.
    """
    batch, objects = scenes.present.shape
    pixels = cameras.width * cameras.height
    device = scenes.positions.device
    depth = torch.zeros(batch * pixels, device=device)
    owners = torch.zeros(batch * pixels, dtype=torch.int32, device=device)
    of_scenes = (scenes.half_axes, scenes.exponents, scenes.rotations, scenes.positions)
    of_cameras = (cameras.intrinsics, cameras.T_world_camera)
    tensors = [one.float().contiguous() for one in (*of_cameras, *of_scenes)]
    present = scenes.present.contiguous()
    _seen(batch * pixels, pixels, cameras.width, objects, *tensors, present, depth, owners)
    shape = (batch, cameras.height, cameras.width)
    return depth.view(shape), owners.view(shape)
