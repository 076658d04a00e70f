"""Noise of depth images, every pixel a function of its image's seed, its place and the depth.

Images are flat: B images of height rows one after the other; `size` is (image width, image height).
Depth is finite; 0 is missing.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop, vectorised
from scenefw.kernels.random import normal, philox, uniform

_ZERO = np.float32(0)
_HALF = np.float32(0.5)
_ONE = np.float32(1)
_NEVER = np.float32(1e30)
_LEAST = np.float32(1e-6)  # metres: what is measured stays measured
_FLOOR_NOISE, _GROWTH, _ORIGIN = np.float32(0.0012), np.float32(0.0019), np.float32(0.4)
_PIXEL, _GRAZING, _IMAGE = 0, 1, 2  # purposes of random words


@element
def _valid_depth(z):
    return max(z, _ZERO)


@element
def _slope(depth, at, step):
    """Central difference of depth per pixel; 0 beside missing pixels."""
    before, after = _valid_depth(depth[at - step]), _valid_depth(depth[at + step])
    return (after - before) * _HALF if before > _ZERO and after > _ZERO else _ZERO


@element
def _grazes(image, u, v, z, depth, intrinsics, seed, size, grazing):
    """Whether a pixel is lost as its ray grazes the surface of the depth image.

    With z(u, v) the surface's normal is along (-fx z_u, -fy z_v, z + (u - cx) z_u + (v - cy) z_v),
    and its product with the ray (x / z, y / z, 1) is z itself.
    """
    first, last, start, range_of_angles = grazing
    width, height = size
    at = (image * height + v) * width + u
    along = _slope(depth, at, 1) if 0 < u < width - 1 else _ZERO
    down = _slope(depth, at, width) if 0 < v < height - 1 else _ZERO
    fx, fy = intrinsics[image, 0], intrinsics[image, 1]
    ahead_u, ahead_v = np.float32(u) - intrinsics[image, 2], np.float32(v) - intrinsics[image, 3]
    nx, ny, nz = fx * along, fy * down, z + ahead_u * along + ahead_v * down
    ray_x, ray_y = ahead_u / fx, ahead_v / fy
    lengths = (nx * nx + ny * ny + nz * nz) * (ray_x * ray_x + ray_y * ray_y + _ONE)
    cosine = z / math.sqrt(lengths)
    if cosine >= first:
        return False
    if cosine <= last:
        return True
    share = (math.acos(cosine) - start) / range_of_angles
    return uniform(philox(seed, v * width + u, _GRAZING)[0]) < share


@element
def _is_disturbed(seed, share):
    return share >= _ONE or uniform(philox(seed, 0, _IMAGE)[0]) < share


@element
def _light(row, depth, intrinsics, seeds, lit, size, baseline, grazing, share):
    """What of a row is lit by the projector and seen by the camera, from the projector's side."""
    width, height = size
    image, v = row // height, row % height
    first = row * width
    seed = seeds[image]
    disturbed = _is_disturbed(seed, share)
    focal = intrinsics[image, 0] * abs(baseline)
    leftmost = _NEVER
    for k in range(width):
        u = width - 1 - k if baseline > _ZERO else k
        z = depth[first + u]
        if disturbed:
            z = _valid_depth(z)
            if z > _ZERO:
                position = np.float32(width - 1 - k) - focal / max(z, _LEAST)
                leftmost = min(leftmost, position)
                if position > leftmost + _ONE or _grazes(
                    image, u, v, z, depth, intrinsics, seed, size, grazing
                ):
                    z = _ZERO
        lit[first + u] = z


@loop
def _light_all(count, depth, intrinsics, seeds, lit, size, baseline, grazing, share):
    for row in prange(count):
        _light(np.int64(row), depth, intrinsics, seeds, lit, size, baseline, grazing, share)


@vectorised
def _draw(pixel, seed, sensor):
    """Shift across and down (pixels), axial noise (standard deviations) and luck of a pixel."""
    across, below, ahead, luck = philox(seed, pixel, _PIXEL)
    u = math.floor(sensor[0] * normal(across) + _HALF)
    v = math.floor(sensor[0] * normal(below) + _HALF)
    return np.float32(u), np.float32(v), normal(ahead), uniform(luck)


@element
def _read_depth(image, u, v, lit, size, axial):
    """The depth that a pixel measures where it is shifted to (u, v), and its axial deviation."""
    width, height = size
    u, v = min(max(u, 0), width - 1), min(max(v, 0), height - 1)
    z = lit[(image * height + v) * width + u]
    offset = z - _ORIGIN
    return z, axial * (_FLOOR_NOISE + _GROWTH * offset * offset)


@vectorised
def _step(z, deviation, ahead, luck, focal, sensor):
    """What is read of a depth: at whole steps of disparity, 0 where it is lost."""
    _, _, step, dropout, nearest, farthest = sensor
    count = np.float32(math.floor(focal / (max(z + deviation * ahead, _LEAST) * step) + _HALF))
    stepped = focal / (max(count, _ONE) * step)
    is_valid = z > _ZERO and luck >= dropout and count > _ZERO
    return stepped if is_valid and stepped >= nearest and stepped <= farthest else _ZERO


@element
def _measure(i, lit, intrinsics, seeds, noisy, size, baseline, sensor, share):
    width, height = size
    row, u = i // width, i % width
    image, v = row // height, row % height
    if _is_disturbed(seeds[image], share):
        focal = intrinsics[image, 0] * abs(baseline)
        across, below, ahead, luck = _draw(v * width + u, seeds[image], sensor)
        z, deviation = _read_depth(image, u + int(across), v + int(below), lit, size, sensor[1])
        noisy[i] = _step(z, deviation, ahead, luck, focal, sensor)
    else:
        noisy[i] = lit[i]


@loop
def _measure_all(count, lit, intrinsics, seeds, noisy, size, baseline, sensor, share):
    width, height = size
    for index in prange(count // width):
        row = np.int64(index)
        image, v = row // height, row % height
        first = row * width
        if _is_disturbed(seeds[image], share):
            focal = intrinsics[image, 0] * abs(baseline)
            samples = np.empty((4, width), np.float32)
            for u in range(width):
                samples[0, u], samples[1, u], samples[2, u], samples[3, u] = _draw(
                    v * width + u, seeds[image], sensor
                )
            for u in range(width):
                across, below = int(samples[0, u]), int(samples[1, u])
                samples[0, u], samples[1, u] = _read_depth(
                    image, u + across, v + below, lit, size, sensor[1]
                )
            for u in range(width):
                noisy[first + u] = _step(
                    samples[0, u], samples[1, u], samples[2, u], samples[3, u], focal, sensor
                )
        else:
            noisy[first : first + width] = lit[first : first + width]


@element
def _add_noise(i, depth, seeds, noisy, pixels, lowest, sigma, share):
    z = depth[i]
    seed = seeds[i // pixels]
    if z <= _ZERO:
        noisy[i] = _ZERO
    elif _is_disturbed(seed, share):
        if lowest < sigma:
            sigma = lowest + (sigma - lowest) * uniform(philox(seed, 0, _IMAGE)[1])
        words = philox(seed, i % pixels, _PIXEL)
        noisy[i] = max(z + sigma * normal(words[0]), _LEAST)
    else:
        noisy[i] = z


@loop
def _add_noise_all(count, depth, seeds, noisy, pixels, lowest, sigma, share):
    for i in prange(count):
        _add_noise(np.int64(i), depth, seeds, noisy, pixels, lowest, sigma, share)


light = Kernel(_light, _light_all)
"""light(B height, depth, intrinsics, seeds, lit, size, baseline, grazing, share): depth without
shadows and grazing surfaces, in disturbed images.

seeds (B,) int64, 0 or more; `grazing` is the cosines of both angles, the first angle and the range
(radians).
"""
measure = Kernel(_measure, _measure_all)
"""measure(B height width, lit, intrinsics, seeds, noisy, size, baseline, sensor, share): what is
read of lit depth; `sensor` is (lateral, axial, step, dropout, nearest, farthest).
"""
add_noise = Kernel(_add_noise, _add_noise_all)
"""add_noise(B pixels, depth, seeds, noisy, pixels, lowest, sigma, share): white noise on measured
pixels of a share of the images.

Its standard deviation is drawn for each image, evenly from `lowest` to `sigma`.
"""
