"""Colour of what rays hit: texture, light of the room, lamps with shadows and highlights.

Any number of scenes stand in shared arrays, which `renderers.tables` makes: rows of triangles in
the order of the trees (corner normals (F, 9), colours (F, 3), `looks` (F, 3) int32: rows of texture
and item, class id), `placements` of items, `textures`, `lights`; and a row of each scene in
`surfaces` (S, 6), colour of the table and light of the room, and in `scenes` (S, 5) int32: first
and end of its boxes, row of the table's texture, first and end of its lamps.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201, ANN202

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
_TABLE_ITEM = -1


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
def _along(placements, item, column, x, y, z):
    """A coordinate in an item's own frame: a column of its rotation times a vector."""
    return (
        placements[item, column] * x
        + placements[item, column + 3] * y
        + placements[item, column + 6] * z
    )


@element
def _share(placements, item, textures, row, x, y, z, size):
    """The texture's share at a world point; patterns move with the object."""
    if item != _TABLE_ITEM:
        ox, oy = x - placements[item, 0], y - placements[item, 1]
        oz = z - placements[item, 2]
        scale = ONE / placements[item, 12]
        x = _along(placements, item, 3, ox, oy, oz) * scale
        y = _along(placements, item, 4, ox, oy, oz) * scale
        z = _along(placements, item, 5, ox, oy, oz) * scale
        size = size * scale
    return pattern(textures, row, x, y, z, size)


@element
def _lamp(lights, j, point, facing, normal, view, gloss, bounds, links, triangles, node, last):
    """Diffuse and highlight strength of a lamp, 0 in its shadow."""
    lx, ly, lz = lights[j, 0] - point[0], lights[j, 1] - point[1], lights[j, 2] - point[2]
    distance = math.sqrt(max(lx * lx + ly * ly + lz * lz, _TINY))
    ax, ay, az = lx / distance, ly / distance, lz / distance
    cosine = normal[0] * ax + normal[1] * ay + normal[2] * az
    if cosine <= ZERO or facing[0] * ax + facing[1] * ay + facing[2] * az <= ZERO:
        return ZERO, ZERO
    ox, oy, oz = (
        point[0] + _LIFT * facing[0],
        point[1] + _LIFT * facing[1],
        point[2] + _LIFT * facing[2],
    )
    if blocked(bounds, links, triangles, node, last, ox, oy, oz, lx, ly, lz, ONE):
        return ZERO, ZERO
    middle = math.sqrt(lights[j, 0] ** 2 + lights[j, 1] ** 2 + lights[j, 2] ** 2)
    fall = (middle / distance) * (middle / distance)
    shine = ZERO
    if gloss > ZERO:
        hx, hy, hz = _unit(ax - view[0], ay - view[1], az - view[2])
        shine = max(ZERO, normal[0] * hx + normal[1] * hy + normal[2] * hz)
        shine = gloss * np.float32(shine**_HIGHLIGHT)
    return cosine * fall, shine * fall


@element
def _painted(colours, looks, placements, textures, surfaces, scenes, scene, k, point, size):
    """Colour of a thing itself under white light, and the row of its texture."""
    row, item = scenes[scene, 2], _TABLE_ITEM
    red, green, blue = surfaces[scene, 0], surfaces[scene, 1], surfaces[scene, 2]
    if k != TABLE:
        row, item = looks[k, 0], looks[k, 1]
        red, green, blue = colours[k, 0], colours[k, 1], colours[k, 2]
    share = _share(placements, item, textures, row, point[0], point[1], point[2], size)
    red += share * (textures[row, 4] - red)
    green += share * (textures[row, 5] - green)
    blue += share * (textures[row, 6] - blue)
    return red, green, blue, row


@element
def shaded(
    bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
    scenes, scene, origin, ahead, hit, size,
):  # fmt: skip
    """Linear colour of what a ray meets, not limited to 1.

    `hit` is what `meshes.first_hit` gives of a ray from `origin` along `ahead`; `size` is the width
    of a pixel there (m).
    """
    k, t, u, v = hit
    if k == NOTHING:
        return ZERO, ZERO, ZERO
    point = (origin[0] + t * ahead[0], origin[1] + t * ahead[1], origin[2] + t * ahead[2])
    view = _unit(ahead[0], ahead[1], ahead[2])
    red, green, blue, row = _painted(
        colours, looks, placements, textures, surfaces, scenes, scene, k, point, size
    )
    fx, fy, fz = ZERO, ZERO, ONE
    nx, ny, nz = fx, fy, fz
    if k != TABLE:
        fx, fy, fz = _face_normal(triangles, k)
        nx, ny, nz = _smooth_normal(normals, k, u, v)
    if fx * view[0] + fy * view[1] + fz * view[2] > ZERO:  # thin things have two sides
        fx, fy, fz = -fx, -fy, -fz
    if fx * nx + fy * ny + fz * nz < ZERO:
        nx, ny, nz = -nx, -ny, -nz
    room = ONE - _FROM_ABOVE * (HALF - HALF * nz)
    light_r, light_g = room * surfaces[scene, 3], room * surfaces[scene, 4]
    light_b = room * surfaces[scene, 5]
    shine_r, shine_g, shine_b = ZERO, ZERO, ZERO
    for j in range(scenes[scene, 3], scenes[scene, 4]):
        diffuse, shine = _lamp(
            lights, j, point, (fx, fy, fz), (nx, ny, nz), view, textures[row, 7],
            bounds, links, triangles, scenes[scene, 0], scenes[scene, 1],
        )  # fmt: skip
        light_r += diffuse * lights[j, 3]
        light_g += diffuse * lights[j, 4]
        light_b += diffuse * lights[j, 5]
        shine_r += shine * lights[j, 3]
        shine_g += shine * lights[j, 4]
        shine_b += shine * lights[j, 5]
    return red * light_r + shine_r, green * light_g + shine_g, blue * light_b + shine_b


@element
def _paint(
    i, colours, looks, placements, textures, surfaces, scenes, points, hits, size, painted
):  # fmt: skip
    point = (points[i, 0], points[i, 1], points[i, 2])
    painted[i, 0], painted[i, 1], painted[i, 2], _ = _painted(
        colours, looks, placements, textures, surfaces, scenes, 0, hits[i], point, size
    )


@loop
def _paint_all(
    count, colours, looks, placements, textures, surfaces, scenes, points, hits, size, painted
):  # fmt: skip
    for i in prange(count):
        _paint(
            np.int64(i),
            colours,
            looks,
            placements,
            textures,
            surfaces,
            scenes,
            points,
            hits,
            size,
            painted,
        )


paint = Kernel(_paint, _paint_all)
"""paint(P, arrays of scenes..., points (P, 3), hits (P,), size, painted (P, 3)): colours without
light of points of the first scene; hits are rows of triangles or TABLE.
"""
