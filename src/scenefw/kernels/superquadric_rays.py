"""Which superquadric a ray meets first: one ray per pixel, without a volume.

A ray is cut to the box about an object. There eq. 5.1 minus one, as a function of the way along
the ray, is convex and at most 2; Newton from either end is monotone, as it never passes a root.
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
def _slab(o, d, t_near, t_far):
    """The part of a ray o + t d with |o + t d| <= 1, in what is left of it."""
    if abs(d) < _NEAR:
        return (t_near, t_far) if abs(o) <= _ONE else (_FAR, -_FAR)
    a, b = (-_ONE - o) / d, (_ONE - o) / d
    return max(t_near, min(a, b)), min(t_far, max(a, b))


@element
def _term(o, d, t, r):
    """|o + t d|^r and its derivative by t."""
    u = o + t * d
    size = max(abs(u), _NEAR)
    power = exp(r * log(size))
    slope = r * power / size * d
    return power, slope if u >= _ZERO else -slope


@element
def _root(o, d, r, start, end):
    """Where a ray meets the surface on the way from one end of the box to the other.

    Args:
        o: where the ray starts, in units of half-axes.
        d: its direction.
        r: exponents.
        start: way along the ray to begin at.
        end: way along the ray to give up at.
    """
    t = start
    onward = _ONE if end > start else -_ONE
    for _ in range(_STEPS):
        vx, sx = _term(o[0], d[0], t, r[0])
        vy, sy = _term(o[1], d[1], t, r[1])
        vz, sz = _term(o[2], d[2], t, r[2])
        above, slope = vx + vy + vz - _ONE, sx + sy + sz
        if above < _SMALL:
            return t
        if slope * onward >= _ZERO:
            return _FAR
        t -= above / slope
        if (t - end) * onward > _ZERO:
            return _FAR
    return t


@element
def _box(o, d):
    """The part of a ray in the box about an object."""
    t_near, t_far = _slab(o[0], d[0], _ZERO, _FAR)
    t_near, t_far = _slab(o[1], d[1], t_near, t_far)
    return _slab(o[2], d[2], t_near, t_far)


@element
def _interval(o, d, r):
    """Where a ray enters and leaves, in units of its direction; `_FAR` twice if it doesn't."""
    t_near, t_far = _box(o, d)
    if t_near >= t_far:
        return _FAR, _FAR
    enters = _root(o, d, r, t_near, t_far)
    if enters >= _FAR:
        return _FAR, _FAR
    leaves = _root(o, d, r, t_far, t_near)
    return enters, leaves if leaves < _FAR else enters  # a ray that only grazes it


@element
def _hit(o, d, r):
    """Where a ray meets the surface first, in units of its direction; `_FAR` if it doesn't."""
    t_near, t_far = _box(o, d)
    return _root(o, d, r, t_near, t_far) if t_near < t_far else _FAR


@element
def _hit_hollow(t, o, d, r, hole_o, hole_d, hole_r):
    """Where a ray that enters a solid at t meets what a hole leaves of it."""
    opens, closes = _interval(hole_o, hole_d, hole_r)
    if opens > t or closes <= t:
        return t
    return closes if closes < _interval(o, d, r)[1] else _FAR


@element
def _along(rotations, b, k, axis, x, y, z):
    """A direction of the world along an axis of an object."""
    first, second = rotations[b, k, 0, axis] * x, rotations[b, k, 1, axis] * y
    return first + second + rotations[b, k, 2, axis] * z


@element
def _in_units(b, k, x, y, z, axes, rotations):
    """A direction of the world in an object's frame, in units of its half-axes."""
    return (
        _along(rotations, b, k, 0, x, y, z) / axes[b, k, 0],
        _along(rotations, b, k, 1, x, y, z) / axes[b, k, 1],
        _along(rotations, b, k, 2, x, y, z) / axes[b, k, 2],
    )


@element
def _meet(b, k, poses, ray, axes, exponents, rotations, positions):
    """A ray as an object sees it: its start, its direction, and the exponents."""
    o = _in_units(
        b, k, poses[b, 0, 3] - positions[b, k, 0], poses[b, 1, 3] - positions[b, k, 1],
        poses[b, 2, 3] - positions[b, k, 2], axes, rotations,
    )  # fmt: skip
    d = _in_units(b, k, ray[0], ray[1], ray[2], axes, rotations)
    return o, d, (exponents[b, k, 0], exponents[b, k, 1], exponents[b, k, 2])


@element
def _see(i, pixels, width, objects, intrinsics, poses, axes, exponents, rotations, positions,
         hole_axes, hole_exponents, hole_rotations, hole_positions, present, hollow, depth,
         owners):  # fmt: skip
    b, p = i // pixels, i % pixels
    v, u = p // width, p % width
    x = (np.float32(u) - intrinsics[b, 2]) / intrinsics[b, 0]
    y = (np.float32(v) - intrinsics[b, 3]) / intrinsics[b, 1]
    ray = (
        poses[b, 0, 0] * x + poses[b, 0, 1] * y + poses[b, 0, 2],
        poses[b, 1, 0] * x + poses[b, 1, 1] * y + poses[b, 1, 2],
        poses[b, 2, 0] * x + poses[b, 2, 1] * y + poses[b, 2, 2],
    )
    best, owner = _FAR, 0
    for k in range(objects):
        if not present[b, k]:
            continue
        o, d, r = _meet(b, k, poses, ray, axes, exponents, rotations, positions)
        t = _hit(o, d, r)
        if t < best and hollow[b, k]:
            hole_o, hole_d, hole_r = _meet(
                b, k, poses, ray, hole_axes, hole_exponents, hole_rotations, hole_positions
            )
            t = _hit_hollow(t, o, d, r, hole_o, hole_d, hole_r)
        if t < best:
            best, owner = t, k + 1
    depth[i] = best if owner else _ZERO
    owners[i] = owner


@loop
def _see_all(count, pixels, width, objects, intrinsics, poses, axes, exponents, rotations,
             positions, hole_axes, hole_exponents, hole_rotations, hole_positions, present, hollow,
             depth, owners):  # fmt: skip
    for i in prange(count):
        _see(np.int64(i), pixels, width, objects, intrinsics, poses, axes, exponents, rotations,
             positions, hole_axes, hole_exponents, hole_rotations, hole_positions, present, hollow,
             depth, owners)  # fmt: skip


_see_kernel = Kernel(_see, _see_all)


def first_hits(
    scenes: SceneParameters, cameras: CameraBatch, holes: SceneParameters | None = None
) -> tuple[Tensor, Tensor]:
    """What cameras see of superquadrics, without the floor.

    Args:
        scenes: B of up to N superquadrics.
        cameras: one for each.
        holes: B of N superquadrics; one that is present is cut out of the object of its number.
            None: all objects are solid.

    Returns:
        z-depth (B, H, W) in metres, 0 = nothing, and which object (B, H, W) int32 it is of,
        0 = none, i + 1 = object i.
    """
    batch, objects = scenes.present.shape
    pixels = cameras.width * cameras.height
    device = scenes.positions.device
    depth = torch.zeros(batch * pixels, device=device)
    owners = torch.zeros(batch * pixels, dtype=torch.int32, device=device)
    cutouts = scenes if holes is None else holes
    hollow = torch.zeros_like(scenes.present) if holes is None else holes.present
    solids = [
        getattr(parameters, name)
        for parameters in (scenes, cutouts)
        for name in ("half_axes", "exponents", "rotations", "positions")
    ]
    of_cameras = (cameras.intrinsics, cameras.T_world_camera)
    tensors = [tensor.float().contiguous() for tensor in (*of_cameras, *solids)]
    masks = [mask.contiguous() for mask in (scenes.present, hollow)]
    _see_kernel(batch * pixels, pixels, cameras.width, objects, *tensors, *masks, depth, owners)
    shape = (batch, cameras.height, cameras.width)
    return depth.view(shape), owners.view(shape)
