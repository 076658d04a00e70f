"""Steps of the Levenberg-Marquardt method that fits superquadrics, one start per element.

A start is a row of `states`: centre (3), rotation (9), logarithms of half-axes (3), free numbers
of the exponents (3), damping, cost, logarithms of the half-axes that are taken where the places say
nothing (3). `objects` says which places it is fitted to: those of its
surface from `first` to `middle`, those outside of it from there to `last`. A row of `work` holds
normal equations of the state and of the next one, their factor, the step, the next state, and
slopes of a block of places, and one of `lanes` the places themselves: loops over a block are
vectorised.

Distances are of first order, (1 - 1/g) / |grad ln g| of the gauge g: the factor by which the shape
must grow to reach a place.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.elementary import exp, log

NUMBERS = 12  # 3 of the centre, 3 of the rotation, 3 logarithms of half-axes, 3 of exponents
STATE = 23
DAMPING, COST, TYPICAL = 18, 19, 20

_EQUATIONS = NUMBERS * NUMBERS + NUMBERS
_FACTOR = 2 * _EQUATIONS
_STEP = _FACTOR + NUMBERS * NUMBERS
_NEXT = _STEP + NUMBERS
_MOVED = 18
_BLOCK = 64  # places whose slopes are summed at a time, in loops that compilers vectorise
_WEIGHTED = _NEXT + _MOVED
_WEIGHTS = _WEIGHTED + _BLOCK
_RESIDUALS = _WEIGHTS + _BLOCK
_SLOPES = _RESIDUALS + _BLOCK
WORK = _SLOPES + NUMBERS * _BLOCK
_X, _Y, _Z, _U, _V, _W, _GAUGE, _SIGMA, _SURFACE = range(0, 9 * _BLOCK, _BLOCK)
LANES = 9 * _BLOCK
_ZERO, _ONE = np.float32(0), np.float32(1)
_TINY = np.float32(1e-9)
_NEAR = np.float32(1e-5)  # a Newton step of less leaves an error of its square
_DEEPEST = np.float32(-3)
_LEAST_SLOPE = np.float32(1e-3)
_NEWTON_STEPS = 12
_TRIALS = 6
_ANY_COST = 1e30  # more than any start costs
_ENOUGH = 1e-5  # a gain below this share of the cost is the last


@element
def _exponent(free, low, high):
    """An exponent within its bounds, and its slope by the free number."""
    share = 1 / (1 + math.exp(-free))
    value = math.exp(low + (high - low) * share)
    return np.float32(value), np.float32(value * (high - low) * share * (1 - share))


@element
def _far(value):
    """The size of a number, at least tiny."""
    return max(abs(value), _TINY)


@element
def _safe(value):
    return value if abs(value) >= _TINY else _TINY


@element
def _evaluate(i, base, places, sigmas, objects, states, work, lanes, settings, limit):
    """Cost per surface point of the next state; its normal equations go to `base` of the row."""
    row, lane = work[i], lanes[i]
    for k in range(base, base + _EQUATIONS):
        row[k] = 0.0
    rx, dx = _exponent(row[_NEXT + 15], settings[0], settings[1])
    ry, dy = _exponent(row[_NEXT + 16], settings[0], settings[1])
    rz, dz = _exponent(row[_NEXT + 17], settings[0], settings[1])
    middle, last = objects[i, 1], objects[i, 2]
    cost = 0.0
    for start in range(objects[i, 0], last, _BLOCK):
        _localise(row, lane, places, start, min(_BLOCK, last - start))
        count = _pick(lane, sigmas, start, min(_BLOCK, last - start), middle)
        if count > 0:
            _gauges(lane, count, rx, ry, rz)
            cost += _slopes(row, lane, count, rx, ry, rz, dx, dy, dz, limit)
            _add_block(row, base, count)
    cost += _uncommon(i, base, states, work, settings)
    return cost / max(middle - objects[i, 0], 1)


@element
def _localise(row, lane, places, start, count):
    """Places of a block in the frame of the next state, and logarithms by half-axes."""
    cx, cy, cz = row[_NEXT], row[_NEXT + 1], row[_NEXT + 2]
    r00, r01, r02 = row[_NEXT + 3], row[_NEXT + 4], row[_NEXT + 5]
    r10, r11, r12 = row[_NEXT + 6], row[_NEXT + 7], row[_NEXT + 8]
    r20, r21, r22 = row[_NEXT + 9], row[_NEXT + 10], row[_NEXT + 11]
    ax, ay, az = (
        np.float32(row[_NEXT + 12]),
        np.float32(row[_NEXT + 13]),
        np.float32(row[_NEXT + 14]),
    )
    for p in range(count):
        x, y, z = places[start + p, 0] - cx, places[start + p, 1] - cy, places[start + p, 2] - cz
        lx, ly, lz = (
            np.float32(x * r00 + y * r10 + z * r20),
            np.float32(x * r01 + y * r11 + z * r21),
            np.float32(x * r02 + y * r12 + z * r22),
        )
        lane[_X + p], lane[_Y + p], lane[_Z + p] = lx, ly, lz
        lane[_U + p] = log(_far(lx)) - ax
        lane[_V + p] = log(_far(ly)) - ay
        lane[_W + p] = log(_far(lz)) - az


@element
def _pick(lane, sigmas, start, count, middle):
    """Moves places of a block to its front that may say something; how many these are.

    What is to lie outside says nothing beyond the box: the gauge is no less than any of the three.
    """
    picked = 0
    for p in range(count):
        largest = max(lane[_U + p], lane[_V + p], lane[_W + p])
        on_surface = start + p < middle
        if on_surface or largest < _ZERO:
            for k in range(6):
                lane[k * _BLOCK + picked] = lane[k * _BLOCK + p]
            lane[_GAUGE + picked] = largest
            lane[_SIGMA + picked] = sigmas[start + p]
            lane[_SURFACE + picked] = _ONE if on_surface else _ZERO
            picked += 1
    return picked


@element
def _gauges(lane, count, rx, ry, rz):
    """The g with sum e^(r_i (u_i - g)) = 1 of each place, by Newton's method from below."""
    for _ in range(_NEWTON_STEPS):
        squares = _ZERO
        for p in range(count):
            gauge = lane[_GAUGE + p]
            vx = exp(rx * (lane[_U + p] - gauge))
            vy = exp(ry * (lane[_V + p] - gauge))
            vz = exp(rz * (lane[_W + p] - gauge))
            total = vx + vy + vz
            step = log(total) * total / (rx * vx + ry * vy + rz * vz)
            lane[_GAUGE + p] = gauge + step
            squares += step * step
        if squares < _NEAR * _NEAR:
            break


@element
def _slopes(row, lane, count, rx, ry, rz, dx, dy, dz, limit):
    """Residuals of a block, their weights and slopes; what it costs."""
    cost = 0.0
    for p in range(count):
        gauge = lane[_GAUGE + p]
        lx, ly, lz = lane[_X + p], lane[_Y + p], lane[_Z + p]
        ux, uy, uz = lane[_U + p] - gauge, lane[_V + p] - gauge, lane[_W + p] - gauge
        vx, vy, vz = exp(rx * min(ux, _ZERO)), exp(ry * min(uy, _ZERO)), exp(rz * min(uz, _ZERO))
        total = rx * vx + ry * vy + rz * vz
        sx, sy, sz = rx * vx / total, ry * vy / total, rz * vz / total
        gx, gy, gz = sx / _safe(lx), sy / _safe(ly), sz / _safe(lz)
        steep = max(np.float32(math.sqrt(gx * gx + gy * gy + gz * gz)), _LEAST_SLOPE)
        shrunk = exp(-max(gauge, _DEEPEST))
        scale = shrunk / (steep * lane[_SIGMA + p])
        residual = (_ONE - shrunk) / (steep * lane[_SIGMA + p])
        row[_SLOPES + p] = -scale * gx
        row[_SLOPES + _BLOCK + p] = -scale * gy
        row[_SLOPES + 2 * _BLOCK + p] = -scale * gz
        # A turn w of the frame moves a local point by -w x point: the gauge by w (slope x point)
        row[_SLOPES + 3 * _BLOCK + p] = scale * (gy * lz - gz * ly)
        row[_SLOPES + 4 * _BLOCK + p] = scale * (gz * lx - gx * lz)
        row[_SLOPES + 5 * _BLOCK + p] = scale * (gx * ly - gy * lx)
        row[_SLOPES + 6 * _BLOCK + p] = -scale * sx
        row[_SLOPES + 7 * _BLOCK + p] = -scale * sy
        row[_SLOPES + 8 * _BLOCK + p] = -scale * sz
        row[_SLOPES + 9 * _BLOCK + p] = scale * vx * ux / total * dx
        row[_SLOPES + 10 * _BLOCK + p] = scale * vy * uy / total * dy
        row[_SLOPES + 11 * _BLOCK + p] = scale * vz * uz / total * dz
        square = float(residual) * residual
        softened = 1.0 + square / (limit * limit)
        on_surface = lane[_SURFACE + p] > _ZERO
        says = 1.0 if on_surface or gauge < _ZERO else 0.0
        cost += says * (square / softened if on_surface else square)
        row[_WEIGHTS + p] = says * (1.0 / (softened * softened) if on_surface else 1.0)
        row[_RESIDUALS + p] = residual
    return cost


@element
def _add_block(row, base, block):
    """Adds the first places of a block of slopes (NUMBERS, _BLOCK) to the normal equations."""
    for a in range(NUMBERS):
        for p in range(block):
            row[_WEIGHTED + p] = row[_WEIGHTS + p] * row[_SLOPES + a * _BLOCK + p]
        total = 0.0
        for p in range(block):
            total += row[_WEIGHTED + p] * row[_RESIDUALS + p]
        row[base + NUMBERS * NUMBERS + a] += total
        for b in range(a + 1):
            total = 0.0
            for p in range(block):
                total += row[_WEIGHTED + p] * row[_SLOPES + b * _BLOCK + p]
            row[base + NUMBERS * a + b] += total


@element
def _uncommon(i, base, states, work, settings):
    """What sizes and exponents cost that are far from common ones.

    It decides what the places leave open, such as the thickness of a box of which one side is
    seen, and little else.
    """
    cost = 0.0
    for k in range(6):
        far = work[i, _NEXT + 12 + k]
        stiff = settings[4]
        if k < 3:
            far -= states[i, TYPICAL + k]
        else:
            stiff *= 0.25
        cost += stiff * far * far
        work[i, base + (6 + k) * (NUMBERS + 1)] += stiff
        work[i, base + NUMBERS * NUMBERS + 6 + k] += stiff * far
    return cost


@element
def _solve(i, base, work, damping):
    """The damped step, by Cholesky's method."""
    for a in range(NUMBERS):
        for b in range(a + 1):
            total = work[i, base + NUMBERS * a + b]
            if a == b:
                total += damping * (total + 1e-6)
            for k in range(b):
                total -= work[i, _FACTOR + NUMBERS * a + k] * work[i, _FACTOR + NUMBERS * b + k]
            if a == b:
                work[i, _FACTOR + NUMBERS * a + a] = math.sqrt(max(total, 1e-12))
            else:
                work[i, _FACTOR + NUMBERS * a + b] = total / work[i, _FACTOR + NUMBERS * b + b]
    for a in range(NUMBERS):
        total = -work[i, base + NUMBERS * NUMBERS + a]
        for k in range(a):
            total -= work[i, _FACTOR + NUMBERS * a + k] * work[i, _STEP + k]
        work[i, _STEP + a] = total / work[i, _FACTOR + NUMBERS * a + a]
    for offset in range(NUMBERS):
        a = NUMBERS - 1 - offset
        total = work[i, _STEP + a]
        for k in range(a + 1, NUMBERS):
            total -= work[i, _FACTOR + NUMBERS * k + a] * work[i, _STEP + k]
        work[i, _STEP + a] = total / work[i, _FACTOR + NUMBERS * a + a]
    for a in range(NUMBERS):
        work[i, _STEP + a] = max(min(work[i, _STEP + a], 0.5), -0.5)


@element
def _move(i, states, work, settings):
    """The next state: this one and the step."""
    for row in range(3):
        shift = 0.0
        for k in range(3):
            shift += states[i, 3 + 3 * row + k] * work[i, _STEP + k]
        work[i, _NEXT + row] = states[i, row] + shift
    _turn(i, states, work)
    for k in range(3):
        axis = states[i, 12 + k] + work[i, _STEP + 6 + k]
        work[i, _NEXT + 12 + k] = max(min(axis, settings[3]), settings[2])
        free = states[i, 15 + k] + work[i, _STEP + 9 + k]
        work[i, _NEXT + 15 + k] = max(min(free, 6.0), -6.0)


@element
def _turn(i, states, work):
    """The rotation turned by the step, by Rodrigues' formula."""
    wx, wy, wz = work[i, _STEP + 3], work[i, _STEP + 4], work[i, _STEP + 5]
    angle = math.sqrt(wx * wx + wy * wy + wz * wz)
    s, c = 1.0, 0.5
    if angle > 1e-9:
        s, c = math.sin(angle) / angle, (1 - math.cos(angle)) / (angle * angle)
    d = 1 - c * angle * angle
    t00, t01, t02 = d + c * wx * wx, c * wx * wy - s * wz, c * wx * wz + s * wy
    t10, t11, t12 = c * wx * wy + s * wz, d + c * wy * wy, c * wy * wz - s * wx
    t20, t21, t22 = c * wx * wz - s * wy, c * wy * wz + s * wx, d + c * wz * wz
    for row in range(3):
        a, b, e = states[i, 3 + 3 * row], states[i, 4 + 3 * row], states[i, 5 + 3 * row]
        work[i, _NEXT + 3 + 3 * row] = a * t00 + b * t10 + e * t20
        work[i, _NEXT + 4 + 3 * row] = a * t01 + b * t11 + e * t21
        work[i, _NEXT + 5 + 3 * row] = a * t02 + b * t12 + e * t22


@element
def _advance(i, places, sigmas, objects, states, work, lanes, settings, steps, limit):
    """Takes steps until nothing improves; one call evaluates, as its code is long to compile."""
    for k in range(_MOVED):
        work[i, _NEXT + k] = states[i, k]
    cost, damping, base = _ANY_COST, states[i, DAMPING], _EQUATIONS
    taken, failed = -1, 0  # steps; the first cost is that of the start
    while failed < _TRIALS:
        other = _EQUATIONS - base
        trial = _evaluate(i, other, places, sigmas, objects, states, work, lanes, settings, limit)
        if trial < cost:
            gain, cost, base = cost - trial, trial, other
            for k in range(_MOVED):
                states[i, k] = work[i, _NEXT + k]
            if taken >= 0:
                damping = max(damping / 4, 1e-6)
            taken, failed = taken + 1, 0
            if taken == steps or gain < _ENOUGH * cost:
                break
        else:
            damping, failed = min(damping * 5, 1e4), failed + 1
        _solve(i, base, work, damping)
        _move(i, states, work, settings)
    states[i, DAMPING], states[i, COST] = damping, cost


@loop
def _advance_all(count, places, sigmas, objects, states, work, lanes, settings, steps, limit):
    for i in prange(count):
        _advance(np.int64(i), places, sigmas, objects, states, work, lanes, settings, steps, limit)


advance = Kernel(
    _advance,
    _advance_all,
    types="i8, f4[:, ::1], f4[::1], i4[:, ::1], f8[:, ::1], f8[:, ::1], f4[:, ::1], "
    "f8[::1], i8, f8",
)
"""Moves starts (S, STATE) towards their minima.

Args: count; places (P, 3) float32; their standard deviations (P,) float32; `first`, `middle` and
`last` place of each start (S, 3) int32; states (S, STATE) float64, changed; work (S, WORK) float64;
lanes (S, LANES) float32;
settings (5,) float64: logarithms of the least and greatest exponent and half-axis, and stiffness;
steps; deviations from which on places of the surface count less and
less (Geman and McClure 1987).
"""
