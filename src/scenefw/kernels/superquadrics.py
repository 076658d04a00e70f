"""Signed distance to superquadrics |x/a1|^r + |y/a2|^s + |z/a3|^t = 1 (eq. 5.1).

Exponents are 1.1 or more. By symmetry a point p >= 0 of one octant is enough. Everything is float32
in logarithms, as u^100 leaves the range of float32: b_i = ln(p_i / a_i), and y_i = ln(q_i / a_i) of
a surface point q.
"""

import math

import numpy as np

from scenefw.kernels.compile import element
from scenefw.kernels.elementary import exp, log

_ZERO = np.float32(0)
_ONE = np.float32(1)
_TWO = np.float32(2)
_LN2 = np.float32(math.log(2))
_TINY = np.float32(1e-30)
_NEAR = np.float32(1e-9)
_TOLERANCE = np.float32(3e-2)
_OUTSIDE_STEPS = 10
_INSIDE_STEPS = 5
_NEGLIGIBLE = np.float32(2e-5)
_SHORTER = np.float32(0.3)
_STIFF = np.float32(0.2)


@element
def signed_distance(px, py, pz, ax, ay, az, rx, ry, rz, limit):  # noqa: ANN001, ANN201
    """Signed distance (m) of the point p >= 0 of the object's frame; negative inside.

    Distances of `limit` and more may come out as `limit`, which is quicker.
    """
    px, py, pz = max(px, _NEAR), max(py, _NEAR), max(pz, _NEAR)
    bx, by, bz = log(px / ax), log(py / ay), log(pz / az)
    if max(bx, by, bz) >= _ZERO or exp(rx * bx) + exp(ry * by) + exp(rz * bz) >= _ONE:
        return _outside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz, limit)
    return -_inside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz)


@element
def is_inside(ux, uy, uz, rx, ry, rz):  # noqa: ANN001, ANN201
    """Whether a point u >= 0, in units of the half-axes, lies inside."""
    if max(ux, uy, uz) >= _ONE:
        return False
    vx = exp(rx * log(max(ux, _NEAR)))
    vy = exp(ry * log(max(uy, _NEAR)))
    vz = exp(rz * log(max(uz, _NEAR)))
    return vx + vy + vz < _ONE


@element
def _radial(bx, by, bz, rx, ry, rz, steps):  # noqa: ANN001, ANN202
    """The shift c with sum e^(r_i (b_i + c)) = 1: scaling by e^c brings the point to the surface.

    The logarithm of the sum is convex and increasing in c, so Newton from the right is monotone.
    """
    c = -max(bx, by, bz)
    for _ in range(steps):
        vx = exp(rx * (bx + c))
        vy = exp(ry * (by + c))
        vz = exp(rz * (bz + c))
        total = vx + vy + vz
        c -= log(total) * total / (rx * vx + ry * vy + rz * vz)
    return c


@element
def _stretch(y, k, r, b):  # noqa: ANN001, ANN202
    """Newton terms of h(y) = ln((e^y + e^(k + (r - 1) y)) / e^b) = 0: h / h_y and h_k / h_y."""
    linear = exp(y - b)
    power = exp(k + (r - _ONE) * y - b)
    slope = linear + (r - _ONE) * power
    total = linear + power
    return log(total) * total / slope, power / slope


@element
def _bounded(y, k, r, b):  # noqa: ANN001, ANN202
    """`y` moved to where the root of h must lie: one term alone makes all, or half, of e^b."""
    high = min(b, (b - k) / (r - _ONE + _NEAR))
    return max(min(y, high), high - _LN2 / min(r - _ONE + _NEAR, _ONE))


@element
def _outside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz, limit):  # noqa: ANN001, ANN202
    """Distance of an outside point by Newton's method on the Lagrange conditions.

    q_i + l (r_i / a_i) (q_i / a_i)^(r_i - 1) = p_i and sum (q_i / a_i)^r_i = 1, in y and ln l.
    The first guess of l is from the point clamped to the box and scaled to the surface; the plane
    that touches there bounds the distance from below.
    """
    cx, cy, cz = min(bx, _ZERO), min(by, _ZERO), min(bz, _ZERO)
    c = _radial(cx, cy, cz, rx, ry, rz, 2)
    gx, gy, gz = rx / ax, ry / ay, rz / az
    nx = gx * exp((rx - _ONE) * (cx + c))
    ny = gy * exp((ry - _ONE) * (cy + c))
    nz = gz * exp((rz - _ONE) * (cz + c))
    dx = px - ax * exp(cx + c)
    dy = py - ay * exp(cy + c)
    dz = pz - az * exp(cz + c)
    ascent, steepness = dx * nx + dy * ny + dz * nz, nx * nx + ny * ny + nz * nz
    if ascent > _ZERO and ascent * ascent >= limit * limit * steepness:
        return limit
    scale = log(max(ascent / steepness, _NEAR))
    kx, ky, kz = log(gx / ax), log(gy / ay), log(gz / az)
    yx = _bounded(cx + c, kx + scale, rx, bx)
    yy = _bounded(cy + c, ky + scale, ry, by)
    yz = _bounded(cz + c, kz + scale, rz, bz)
    for _ in range(_OUTSIDE_STEPS):
        hx, sx = _stretch(yx, kx + scale, rx, bx)
        hy, sy = _stretch(yy, ky + scale, ry, by)
        hz, sz = _stretch(yz, kz + scale, rz, bz)
        top = max(rx * yx, ry * yy, rz * yz)
        wx = exp(rx * yx - top)
        wy = exp(ry * yy - top)
        wz = exp(rz * yz - top)
        total = wx + wy + wz
        level = top + log(total)
        wx, wy, wz = wx * rx, wy * ry, wz * rz
        step = level * total - wx * hx - wy * hy - wz * hz
        step = step / max(wx * sx + wy * sy + wz * sz, _TINY)
        step = max(min(step, _TWO), -_TWO)
        scale += step
        yx = _bounded(yx - hx - sx * step, kx + scale, rx, bx)
        yy = _bounded(yy - hy - sy * step, ky + scale, ry, by)
        yz = _bounded(yz - hz - sz * step, kz + scale, rz, bz)
        if max(abs(step), abs(level), abs(hx), abs(hy), abs(hz)) < _TOLERANCE:
            break
    return _length(px - ax * exp(yx), py - ay * exp(yy), pz - az * exp(yz))


@element
def _length(x, y, z):  # noqa: ANN001, ANN202
    return math.sqrt(x * x + y * y + z * z)


@element
def _axis_factor(x, y, r):  # noqa: ANN001, ANN202
    """The factor (1 - x - y)^(1/r): where the axis that is left meets the surface."""
    return exp(log(max(_ONE - x - y, _TINY)) / r)


@element
def _inside(px, py, pz, ax, ay, az, rx, ry, rz, bx, by, bz):  # noqa: ANN001, ANN202
    """Depth of an inside point: the best of the radial and the three axis projections, refined.

    Every candidate lies on the surface, so the depth is never less than the true one.
    """
    vx, vy, vz = exp(rx * bx), exp(ry * by), exp(rz * bz)
    c = exp(_radial(bx, by, bz, rx, ry, rz, 3))
    qx, qy, qz = px * c, py * c, pz * c
    best = _length(qx - px, qy - py, qz - pz)
    ex, ey, ez = (
        ax * _axis_factor(vy, vz, rx),
        ay * _axis_factor(vx, vz, ry),
        az * _axis_factor(vx, vy, rz),
    )
    if ex - px < best:
        best, qx, qy, qz = ex - px, ex, py, pz
    if ey - py < best:
        best, qx, qy, qz = ey - py, px, ey, pz
    if ez - pz < best:
        best, qx, qy, qz = ez - pz, px, py, ez
    damping = _ONE
    for _ in range(_INSIDE_STEPS):
        sx, sy, sz = _step(px, py, pz, qx, qy, qz, ax, ay, az, rx, ry, rz)
        ex = max(abs(qx + damping * sx), _NEAR)
        ey = max(abs(qy + damping * sy), _NEAR)
        ez = max(abs(qz + damping * sz), _NEAR)
        bx, by, bz = log(ex / ax), log(ey / ay), log(ez / az)
        c = exp(_radial(bx, by, bz, rx, ry, rz, 3))
        ex, ey, ez = ex * c, ey * c, ez * c
        distance = _length(ex - px, ey - py, ez - pz)
        gain = best - distance
        if gain > _ZERO:
            best, qx, qy, qz = distance, ex, ey, ez
            damping = min(damping * _TWO, _ONE)
        else:
            damping *= _SHORTER
        if abs(gain) < _NEGLIGIBLE:
            break
    return best


@element
def _step(px, py, pz, qx, qy, qz, ax, ay, az, rx, ry, rz):  # noqa: ANN001, ANN202
    """Newton step along the surface from its point q to the one nearest to the inside point p.

    Minimises |q - p|^2 / 2 with the constraint linearised: (1 - m H) s = p - q - c g with s g = 0,
    g and the diagonal H the derivatives of eq. 5.1 and m the multiplier. Where the surface bends
    more than the ball around p, 1 - m H is kept positive, so that the step still descends.
    """
    ux, uy, uz = qx / ax, qy / ay, qz / az
    gx = rx / ax * exp((rx - _ONE) * log(ux))
    gy = ry / ay * exp((ry - _ONE) * log(uy))
    gz = rz / az * exp((rz - _ONE) * log(uz))
    dx, dy, dz = px - qx, py - qy, pz - qz
    m = -(gx * dx + gy * dy + gz * dz) / (gx * gx + gy * gy + gz * gz)
    wx = _ONE / max(_ONE - m * gx * (rx - _ONE) / (ux * ax), _STIFF)
    wy = _ONE / max(_ONE - m * gy * (ry - _ONE) / (uy * ay), _STIFF)
    wz = _ONE / max(_ONE - m * gz * (rz - _ONE) / (uz * az), _STIFF)
    c = (wx * gx * dx + wy * gy * dy + wz * gz * dz) / (wx * gx * gx + wy * gy * gy + wz * gz * gz)
    return wx * (dx - c * gx), wy * (dy - c * gy), wz * (dz - c * gz)
