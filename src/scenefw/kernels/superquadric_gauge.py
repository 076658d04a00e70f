"""Distance to superquadrics to first order, from the factor by which they must grow to a point."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop

_STEPS = 60
_TOLERANCE = 1e-13
_TINY = 1e-9


@element
def _first_order(i, points, shape, distances):
    """(1 - 1/g) / |grad ln g| of the gauge g, whose logarithm solves a convex, rising equation."""
    px = max(abs(points[i, 0]), _TINY)
    py = max(abs(points[i, 1]), _TINY)
    pz = max(abs(points[i, 2]), _TINY)
    rx, ry, rz = shape[1, 0], shape[1, 1], shape[1, 2]
    bx = math.log(px / shape[0, 0])
    by = math.log(py / shape[0, 1])
    bz = math.log(pz / shape[0, 2])
    s = -max(bx, by, bz)
    vx, vy, vz = 1.0, 1.0, 1.0
    for _ in range(_STEPS):  # Newton from the right never overshoots
        vx = math.exp(rx * (bx + s))
        vy = math.exp(ry * (by + s))
        vz = math.exp(rz * (bz + s))
        total = vx + vy + vz
        step = math.log(total) * total / (rx * vx + ry * vy + rz * vz)
        s -= step
        if abs(step) < _TOLERANCE:
            break
    wx, wy, wz = rx * vx, ry * vy, rz * vz
    weight = wx + wy + wz
    gx, gy, gz = wx / px, wy / py, wz / pz
    distances[i] = (1 - math.exp(s)) * weight / math.sqrt(gx * gx + gy * gy + gz * gz)


@loop
def _first_order_all(count, points, shape, distances):
    for i in prange(count):
        _first_order(np.int64(i), points, shape, distances)


first_order = Kernel(_first_order, _first_order_all, types="i8, f8[:, ::1], f8[:, ::1], f8[::1]")
"""Distances of points to one superquadric, negative inside.

Args: count; points (N, 3) float64 in its frame (m); its half-axes (m) and exponents, (2, 3)
float64; distances (N,) float64, changed.
"""
