"""Exact signed distances to superquadrics |x/a1|^r + |y/a2|^s + |z/a3|^t = 1 (eq. 5.1), r, s, t >= 1.

By symmetry a point p >= 0 of one octant is enough. Everything is float32 in logarithms, as u^100
leaves the range of float32: y_i = ln(q_i / a_i) of the surface point q, b_i = ln(p_i / a_i).
"""

import math

import numpy as np

from scenefw.kernels.compile import element

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_TWO = np.float32(2)
_LN2 = np.float32(math.log(2))
_TINY = np.float32(1e-30)
_NEAR = np.float32(1e-9)
_TOLERANCE = np.float32(3e-2)
_OUTSIDE_STEPS = 10
_INSIDE_STEPS = 4


@element
def signed_distance(px, py, pz, ax, ay, az, rx, ry, rz):  # noqa: ANN001, ANN201, PLR0913
    """Signed distance (m) of the point p >= 0 of the object's frame; negative inside."""
    bx = math.log(max(px, _NEAR) / ax)
    by = math.log(max(py, _NEAR) / ay)
    bz = math.log(max(pz, _NEAR) / az)
    level = _log_sum(rx * bx, ry * by, rz * bz)
    if level > _ZERO:
        return _outside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz)
    return -_inside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz)


@element
def _log_sum(x, y, z):  # noqa: ANN001, ANN202
    """ln(e^x + e^y + e^z) without overflow."""
    top = max(x, max(y, z))
    return top + math.log(math.exp(x - top) + math.exp(y - top) + math.exp(z - top))


@element
def _radial(bx, by, bz, rx, ry, rz, steps):  # noqa: ANN001, ANN202
    """The shift c with sum e^(r_i (b_i + c)) = 1: scaling by e^c brings the point to the surface.

    The logarithm of the sum is convex and increasing in c, so Newton from the right is monotone.
    """
    c = -max(bx, max(by, bz))
    for _ in range(steps):
        vx = math.exp(rx * (bx + c))
        vy = math.exp(ry * (by + c))
        vz = math.exp(rz * (bz + c))
        total = vx + vy + vz
        c -= math.log(total) * total / (rx * vx + ry * vy + rz * vz)
    return c


@element
def _stretch(y, k, r, b):  # noqa: ANN001, ANN202
    """Newton terms of h(y) = ln((e^y + e^(k + (r - 1) y)) / e^b) = 0: h / h_y and h_k / h_y."""
    linear = math.exp(y - b)
    power = math.exp(k + (r - _ONE) * y - b)
    slope = linear + (r - _ONE) * power
    total = linear + power
    return math.log(total) * total / slope, power / slope


@element
def _bounded(y, k, r, b):  # noqa: ANN001, ANN202
    """`y` moved between the bounds of the root of h: one term alone makes up all, or half, of e^b."""
    high = min(b, (b - k) / (r - _ONE + _NEAR))
    return max(min(y, high), high - _LN2)


@element
def _outside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz):  # noqa: ANN001, ANN202, PLR0913
    """Distance of an outside point by Newton's method on the Lagrange conditions.

    q_i + l (r_i / a_i) (q_i / a_i)^(r_i - 1) = p_i and sum (q_i / a_i)^r_i = 1, in y and ln l.
    """
    cx, cy, cz = min(bx, _ZERO), min(by, _ZERO), min(bz, _ZERO)
    c = _radial(cx, cy, cz, rx, ry, rz, 2)
    nx = rx / ax * math.exp((rx - _ONE) * (cx + c))
    ny = ry / ay * math.exp((ry - _ONE) * (cy + c))
    nz = rz / az * math.exp((rz - _ONE) * (cz + c))
    dx = px - ax * math.exp(cx + c)
    dy = py - ay * math.exp(cy + c)
    dz = pz - az * math.exp(cz + c)
    multiplier = (dx * nx + dy * ny + dz * nz) / (nx * nx + ny * ny + nz * nz)
    stretch = math.log(max(multiplier, _NEAR))
    kx = math.log(rx / (ax * ax))
    ky = math.log(ry / (ay * ay))
    kz = math.log(rz / (az * az))
    yx = _bounded(cx + c, kx + stretch, rx, bx)
    yy = _bounded(cy + c, ky + stretch, ry, by)
    yz = _bounded(cz + c, kz + stretch, rz, bz)
    for _ in range(_OUTSIDE_STEPS):
        hx, sx = _stretch(yx, kx + stretch, rx, bx)
        hy, sy = _stretch(yy, ky + stretch, ry, by)
        hz, sz = _stretch(yz, kz + stretch, rz, bz)
        top = max(rx * yx, max(ry * yy, rz * yz))
        wx = math.exp(rx * yx - top)
        wy = math.exp(ry * yy - top)
        wz = math.exp(rz * yz - top)
        total = wx + wy + wz
        level = top + math.log(total)
        wx, wy, wz = wx * rx, wy * ry, wz * rz
        step = (level * total - wx * hx - wy * hy - wz * hz) / max(
            wx * sx + wy * sy + wz * sz, _TINY
        )
        step = max(min(step, _TWO), -_TWO)
        stretch += step
        yx = _bounded(yx - hx - sx * step, kx + stretch, rx, bx)
        yy = _bounded(yy - hy - sy * step, ky + stretch, ry, by)
        yz = _bounded(yz - hz - sz * step, kz + stretch, rz, bz)
        if max(abs(step), abs(level), abs(hx), abs(hy), abs(hz)) < _TOLERANCE:
            break
    dx = px - ax * math.exp(yx)
    dy = py - ay * math.exp(yy)
    dz = pz - az * math.exp(yz)
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@element
def _rest(x, y, r):  # noqa: ANN001, ANN202
    """ln (1 - e^x - e^y)^(1/r): where the axis that is left meets the surface."""
    return math.log(max(_ONE - math.exp(x) - math.exp(y), _TINY)) / r


@element
def _inside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz):  # noqa: ANN001, ANN202, PLR0913
    """Depth of an inside point: the best of the radial and the three axis projections, refined."""
    c = _radial(bx, by, bz, rx, ry, rz, 3)
    qx, qy, qz = px * math.exp(c), py * math.exp(c), pz * math.exp(c)
    best = math.sqrt((qx - px) ** 2 + (qy - py) ** 2 + (qz - pz) ** 2)
    ex = ax * math.exp(_rest(ry * by, rz * bz, rx))
    ey = ay * math.exp(_rest(rx * bx, rz * bz, ry))
    ez = az * math.exp(_rest(rx * bx, ry * by, rz))
    if ex - px < best:
        best, qx, qy, qz = ex - px, ex, py, pz
    if ey - py < best:
        best, qx, qy, qz = ey - py, px, ey, pz
    if ez - pz < best:
        best, qx, qy, qz = ez - pz, px, py, ez
    return best
