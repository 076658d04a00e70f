"""Colour of what rays hit: texture, light of the room, lamps with shadows and highlights."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

from __future__ import annotations

import math

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.meshes import NOTHING, TABLE, blocked
from scenefw.kernels.textures import pattern

ZERO = np.float32(0)
HALF = np.float32(0.5)
ONE = np.float32(1)
_LIFT = np.float32(1e-4)  # m: shadow rays begin this far off the surface
_TINY = np.float32(1e-12)
_FROM_ABOVE = np.float32(0.3)  # share of the room's light that depends on the surface's slope
_HIGHLIGHT = 40.0
_TABLE_ROW, _TABLE_ITEM = 0, -1
_BLOCK, _LANES = 128, 64


@element
def _unit(x, y, z):
    length = math.sqrt(max(x * x + y * y + z * z, _TINY))
    return x / length, y / length, z / length


@element
def _face_normal(triangles, k):
    ax, ay, az = triangles[k, 3], triangles[k, 4], triangles[k, 5]
    bx, by, bz = triangles[k, 6], triangles[k, 7], triangles[k, 8]
    return _unit(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


@element
def _smooth_normal(normals, k, u, v):
    w = ONE - u - v
    return _unit(
        w * normals[k, 0] + u * normals[k, 3] + v * normals[k, 6],
        w * normals[k, 1] + u * normals[k, 4] + v * normals[k, 7],
        w * normals[k, 2] + u * normals[k, 5] + v * normals[k, 8],
    )


@element
def _share(placements, item, textures, row, x, y, z, size):
    """The texture's share at a world point; patterns move with the object."""
    if item != _TABLE_ITEM:
        x, y = x - placements[item, 0], y - placements[item, 1]
        c, s = placements[item, 2], placements[item, 3]
        scale = ONE / placements[item, 4]
        x, y, z, size = (c * x + s * y) * scale, (c * y - s * x) * scale, z * scale, size * scale
    return pattern(textures, row, x, y, z, size)


@element
def _lamp(lights, j, point, facing, normal, view, gloss, bounds, links, triangles):
    """Diffuse and highlight strength of a lamp, 0 in its shadow."""
    lx, ly, lz = lights[j, 0] - point[0], lights[j, 1] - point[1], lights[j, 2] - point[2]
    near = math.sqrt(max(lx * lx + ly * ly + lz * lz, _TINY))
    ax, ay, az = lx / near, ly / near, lz / near
    cosine = normal[0] * ax + normal[1] * ay + normal[2] * az
    if cosine <= ZERO or facing[0] * ax + facing[1] * ay + facing[2] * az <= ZERO:
        return ZERO, ZERO
    ox, oy, oz = (
        point[0] + _LIFT * facing[0],
        point[1] + _LIFT * facing[1],
        point[2] + _LIFT * facing[2],
    )
    if blocked(bounds, links, triangles, ox, oy, oz, lx, ly, lz, ONE):
        return ZERO, ZERO
    middle = math.sqrt(lights[j, 0] ** 2 + lights[j, 1] ** 2 + lights[j, 2] ** 2)
    fall = (middle / near) * (middle / near)
    shine = ZERO
    if gloss > ZERO:
        hx, hy, hz = _unit(ax - view[0], ay - view[1], az - view[2])
        shine = max(ZERO, normal[0] * hx + normal[1] * hy + normal[2] * hz)
        shine = gloss * np.float32(shine**_HIGHLIGHT)
    return cosine * fall, shine * fall


@element
def _shade(
    i, bounds, links, triangles, rays, distance, hit, place, normals, colours, texture_of,
    item_of, placements, textures, surface, lights, ambient, base, spread, colour,
):  # fmt: skip
    k = hit[i]
    colour[i, 0], colour[i, 1], colour[i, 2] = ZERO, ZERO, ZERO
    if k == NOTHING:
        return
    t = distance[i]
    dx, dy, dz = rays[i, 3], rays[i, 4], rays[i, 5]
    point = (rays[i, 0] + t * dx, rays[i, 1] + t * dy, rays[i, 2] + t * dz)
    view = _unit(dx, dy, dz)
    row, item = _TABLE_ROW, _TABLE_ITEM
    fx, fy, fz = ZERO, ZERO, ONE
    nx, ny, nz = fx, fy, fz
    red, green, blue = surface[0], surface[1], surface[2]
    if k != TABLE:
        row, item = texture_of[k], item_of[k]
        red, green, blue = colours[k, 0], colours[k, 1], colours[k, 2]
        fx, fy, fz = _face_normal(triangles, k)
        nx, ny, nz = _smooth_normal(normals, k, place[i, 0], place[i, 1])
    if fx * view[0] + fy * view[1] + fz * view[2] > ZERO:  # thin things have two sides
        fx, fy, fz = -fx, -fy, -fz
    if fx * nx + fy * ny + fz * nz < ZERO:
        nx, ny, nz = -nx, -ny, -nz
    size = base + spread * t
    share = _share(placements, item, textures, row, point[0], point[1], point[2], size)
    red += share * (textures[row, 4] - red)
    green += share * (textures[row, 5] - green)
    blue += share * (textures[row, 6] - blue)
    room = ONE - _FROM_ABOVE * (HALF - HALF * nz)
    light_r, light_g, light_b = room * ambient[0], room * ambient[1], room * ambient[2]
    shine_r, shine_g, shine_b = ZERO, ZERO, ZERO
    for j in range(lights.shape[0]):
        diffuse, shine = _lamp(
            lights, j, point, (fx, fy, fz), (nx, ny, nz), view, textures[row, 7],
            bounds, links, triangles,
        )  # fmt: skip
        light_r += diffuse * lights[j, 3]
        light_g += diffuse * lights[j, 4]
        light_b += diffuse * lights[j, 5]
        shine_r += shine * lights[j, 3]
        shine_g += shine * lights[j, 4]
        shine_b += shine * lights[j, 5]
    colour[i, 0] = red * light_r + shine_r
    colour[i, 1] = green * light_g + shine_g
    colour[i, 2] = blue * light_b + shine_b


@loop
def _shade_all(
    count, bounds, links, triangles, rays, distance, hit, place, normals, colours, texture_of,
    item_of, placements, textures, surface, lights, ambient, base, spread, colour,
):  # fmt: skip
    for lane in prange(_LANES):
        for start in range(lane * _BLOCK, count, _LANES * _BLOCK):
            for i in range(start, min(start + _BLOCK, count)):
                _shade(
                    i, bounds, links, triangles, rays, distance, hit, place, normals, colours,
                    texture_of, item_of, placements, textures, surface, lights, ambient, base,
                    spread, colour,
                )  # fmt: skip


shade = Kernel(_shade, _shade_all)
"""shade(R, tree..., rays, distance, hit, place, rows of triangles..., scene..., colour (R, 3)).

Distances, hits and places are those of `meshes.cast`. Rows of triangles in the tree's order:
corner normals (F, 9), colours (F, 3), rows of textures (F,), items (F,). A pixel sees a width of
base + spread * distance. Colours are linear, not limited to 1.
"""
