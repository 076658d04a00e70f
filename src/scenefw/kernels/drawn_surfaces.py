"""Pictures of triangles on a light floor in soft light, one ray, pixel or row per element.

`view` is (eye x, y, z, nine numbers of the camera's rotation row by row, fx, fy, cx, cy); `places`
(N, 2) float32 are columns and rows, which may lie between pixels. Rays are of length 1 in depth.
A label is 0 where rays meet the floor or nothing; depth is 0 where they meet nothing.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, float32, loop, vectorised
from scenefw.kernels.meshes import BLOCK, LANES, TABLE, first_hit
from scenefw.kernels.rays import HALF, ONE, ZERO, trilinear
from scenefw.kernels.soft_light import brightness

SIDE = 2
"""Rays across and down a pixel of which several are taken."""
_RAYS = SIDE * SIDE
_TINY = np.float32(1e-9)
_TWO = np.float32(2)
_ALIKE = np.float32(0.95)  # cosine of normals beside each other on what looks smooth
_JUMP, _OUTLINE = float32(0.03, 0.45)  # m within an object that have an outline; how bright that is
_FLOOR = float32(0.90, 0.90, 0.91)
_PALE = float32(0.93, 0.93, 0.94)
_HIDDEN = np.float32(0.4)  # share of its colour that an unseen surface keeps
_GRID_LINES, _LINE, _LINE_SHADE = float32(0.05, 0.0011, 0.93)  # m: half their distance and width
_LEAST_SLOPE = np.float32(0.1)
_FADES, _FADED = float32(0.45, 0.55)  # of the floor's reach: where it begins, and how far it takes


@element
def _ahead(view, column, row):
    """Direction in the world of the ray through a place of the image."""
    u, v = (column - view[14]) / view[12], (row - view[15]) / view[13]
    return (
        view[3] * u + view[4] * v + view[5],
        view[6] * u + view[7] * v + view[8],
        view[9] * u + view[10] * v + view[11],
    )


@element
def _meet(i, places, view, bounds, links, triangles, normals, owners, depth, facing, labels):
    dx, dy, dz = _ahead(view, places[i, 0], places[i, 1])
    hit, t, b, c = first_hit(
        bounds, links, triangles, 0, len(links), True, view[0], view[1], view[2], dx, dy, dz
    )
    depth[i], labels[i] = t, 0
    facing[i, 0], facing[i, 1], facing[i, 2] = ZERO, ZERO, ONE if hit == TABLE else ZERO
    if hit < 0:
        return
    a = ONE - b - c
    x = a * normals[hit, 0] + b * normals[hit, 3] + c * normals[hit, 6]
    y = a * normals[hit, 1] + b * normals[hit, 4] + c * normals[hit, 7]
    z = a * normals[hit, 2] + b * normals[hit, 5] + c * normals[hit, 8]
    length = max(np.sqrt(x * x + y * y + z * z), _TINY)
    if x * dx + y * dy + z * dz > ZERO:  # an inner surface
        length = -length
    facing[i, 0], facing[i, 1], facing[i, 2] = x / length, y / length, z / length
    labels[i] = owners[hit]


@loop
def _meet_all(
    count, places, view, bounds, links, triangles, normals, owners, depth, facing, labels
):
    for lane in prange(LANES):
        for start in range(np.int64(lane) * BLOCK, count, LANES * BLOCK):
            for i in range(start, min(start + BLOCK, count)):
                _meet(
                    i, places, view, bounds, links, triangles, normals, owners, depth, facing,
                    labels,
                )  # fmt: skip


@element
def _to_line(x, y):
    """How far a point of the floor is from the nearest line of its grid (m)."""
    period = _TWO * _GRID_LINES
    x = abs(x - period * np.floor(x / period + HALF))
    y = abs(y - period * np.floor(y / period + HALF))
    return min(x, y)


@element
def _from_map(light, size, reach, x, y):
    """Brightness of the floor between samples of its map."""
    top = np.float32(size - 1)
    column = min(max((x / reach + ONE) * HALF * top, ZERO), top)
    row = min(max((y / reach + ONE) * HALF * top, ZERO), top)
    left, upper = min(int(column), size - 2), min(int(row), size - 2)
    right, down = column - np.float32(left), row - np.float32(upper)
    above = light[upper, left] + right * (light[upper, left + 1] - light[upper, left])
    below = light[upper + 1, left] + right * (light[upper + 1, left + 1] - light[upper + 1, left])
    return above + down * (below - above)


@element
def _limited(x):
    return max(ZERO, min(ONE, x))


@element
def _colour(
    i, places, view, depth, facing, labels, light, light_reach, field, n, box, key, palette,
    visibility, is_pale, reach, colours,
):  # fmt: skip
    colours[i, 0], colours[i, 1], colours[i, 2] = ONE, ONE, ONE
    if depth[i] <= ZERO:
        return
    dx, dy, dz = _ahead(view, places[i, 0], places[i, 1])
    x, y, z = view[0] + depth[i] * dx, view[1] + depth[i] * dy, view[2] + depth[i] * dz
    if labels[i] == 0:
        radius = np.sqrt(x * x + y * y) / reach
        if radius > ONE:
            return
        bright = _from_map(light, len(light), light_reach, x, y)
        if _to_line(x, y) < _LINE:
            bright *= _LINE_SHADE
        fade = _limited((radius - _FADES) / _FADED)
        fade *= np.sqrt(fade)
        for k in range(3):
            colours[i, k] = _limited(_FLOOR[k] * bright) * (ONE - fade) + fade
        return
    bright = brightness(field, n, box, x, y, z, facing[i, 0], facing[i, 1], facing[i, 2], key)
    palette_row = labels[i] if labels[i] < len(palette) else 0
    share = ONE
    if is_pale:
        part = trilinear(
            visibility, 0, n, (x - box[1]) / box[0] - HALF, (y - box[2]) / box[0] - HALF,
            (z - box[3]) / box[0] - HALF,
        )  # fmt: skip
        share = _HIDDEN + (ONE - _HIDDEN) * _limited(_TWO * part - HALF)
    for k in range(3):
        colours[i, k] = _limited((_PALE[k] + (palette[palette_row, k] - _PALE[k]) * share) * bright)


@loop
def _colour_all(
    count, places, view, depth, facing, labels, light, light_reach, field, n, box, key, palette,
    visibility, is_pale, reach, colours,
):  # fmt: skip
    for lane in prange(LANES):
        for start in range(np.int64(lane) * BLOCK, count, LANES * BLOCK):
            for i in range(start, min(start + BLOCK, count)):
                _colour(
                    i, places, view, depth, facing, labels, light, light_reach, field, n, box, key,
                    palette, visibility, is_pale, reach, colours,
                )  # fmt: skip


@vectorised
def _differ(depth, facing, labels, i, j):
    if labels[i] != labels[j] or (depth[i] > ZERO) != (depth[j] > ZERO):
        return True
    if depth[i] <= ZERO:
        return False
    cosine = facing[i, 0] * facing[j, 0] + facing[i, 1] * facing[j, 1] + facing[i, 2] * facing[j, 2]
    return cosine < _ALIKE or (labels[i] > 0 and abs(depth[i] - depth[j]) > _JUMP)


@element
def _vary(row, view, size, depth, facing, labels, reach, mask):
    width, height = size
    for column in range(width):
        i = row * width + column
        mask[i] = (
            (column > 0 and _differ(depth, facing, labels, i, i - 1))
            or (column < width - 1 and _differ(depth, facing, labels, i, i + 1))
            or (row > 0 and _differ(depth, facing, labels, i, i - width))
            or (row < height - 1 and _differ(depth, facing, labels, i, i + width))
            or _is_on_line(view, np.float32(column), np.float32(row), depth[i], labels[i], reach)
        )


@element
def _is_on_line(view, column, row, depth, label, reach):
    """Whether a pixel shows some of a line of the floor."""
    if label > 0 or depth <= ZERO:
        return False
    dx, dy, _ = _ahead(view, column, row)
    x, y = view[0] + depth * dx, view[1] + depth * dy
    # A pixel of the floor is longer away from the camera, by the slope of the ray
    slope = min(max(view[2] / depth, _LEAST_SLOPE), ONE)
    return _to_line(x, y) < _LINE + depth / view[12] / slope and x * x + y * y < reach * reach


@loop
def _vary_all(count, view, size, depth, facing, labels, reach, mask):
    for row in prange(count):
        _vary(np.int64(row), view, size, depth, facing, labels, reach, mask)


@element
def _at(pixel, part, numbers, fine, coarse):
    """What a ray of a pixel met, or the pixel's only ray."""
    k = numbers[pixel]
    return coarse[pixel] if k < 0 else fine[_RAYS * k + part]


@element
def _ends(label, depth, pixel, part, numbers, fine_labels, labels, fine_depth, coarse_depth):
    """Whether an object changes, or its depth jumps, from one ray to another."""
    neighbour_label = _at(pixel, part, numbers, fine_labels, labels)
    if neighbour_label != label:
        return True
    return (
        neighbour_label > 0
        and abs(_at(pixel, part, numbers, fine_depth, coarse_depth) - depth) > _JUMP
    )


@element
def _blend(
    k, pixels, numbers, width, fine_labels, fine_depth, fine_colours, labels, depth, picture
):
    pixel = pixels[k]
    is_last_column, is_last_row = pixel % width == width - 1, pixel + width >= len(labels)
    red, green, blue = ZERO, ZERO, ZERO
    for part in range(_RAYS):
        i = _RAYS * k + part
        down, across = part // SIDE, part % SIDE
        inner_right, inner_down = across < SIDE - 1, down < SIDE - 1
        edge = False
        if inner_right or not is_last_column:
            edge = _ends(
                fine_labels[i], fine_depth[i], pixel if inner_right else pixel + 1,
                part + 1 if inner_right else part + 1 - SIDE,
                numbers, fine_labels, labels, fine_depth, depth,
            )  # fmt: skip
        if not edge and (inner_down or not is_last_row):
            edge = _ends(
                fine_labels[i], fine_depth[i], pixel if inner_down else pixel + width,
                part + SIDE if inner_down else across,
                numbers, fine_labels, labels, fine_depth, depth,
            )  # fmt: skip
        shade = _OUTLINE if edge else ONE
        red += shade * fine_colours[i, 0]
        green += shade * fine_colours[i, 1]
        blue += shade * fine_colours[i, 2]
    count = np.float32(_RAYS)
    picture[pixel, 0], picture[pixel, 1], picture[pixel, 2] = (
        red / count,
        green / count,
        blue / count,
    )


@loop
def _blend_all(
    count, pixels, numbers, width, fine_labels, fine_depth, fine_colours, labels, depth, picture
):
    for k in prange(count):
        _blend(
            np.int64(k), pixels, numbers, width, fine_labels, fine_depth, fine_colours, labels,
            depth, picture,
        )  # fmt: skip


_VIEW = "f4[:, ::1], UniTuple(f4, 16)"

meet = Kernel(
    _meet,
    _meet_all,
    types=f"i8, {_VIEW}, f4[:, ::1], i4[:, ::1], f4[:, ::1], f4[:, ::1], i4[::1], "
    "f4[::1], f4[:, ::1], i4[::1]",
)
"""meet(N, places, view, bounds, links, triangles, normals, owners, depth, facing, labels).

The tree is that of `meshes`; `normals` (F, 9) are of the corners of its triangles, `owners` (F,)
their labels. Found are `depth` (N,), normals `facing` (N, 3) towards the eye, `labels` (N,) int32.
"""
colour = Kernel(
    _colour,
    _colour_all,
    types=f"i8, {_VIEW}, f4[::1], f4[:, ::1], i4[::1], f4[:, ::1], f4, f4[::1], i8, "
    "UniTuple(f4, 4), UniTuple(f4, 3), f4[:, ::1], f4[::1], b1, f4, f4[:, ::1]",
)
"""colour(N, places, view, depth, facing, labels, light, light_reach, field, n, box, key, palette,
visibility, is_pale, reach, colours): colours (N, 3) of what rays meet; white where they meet
nothing.

`light` (S, S) is the map of `soft_light.floor_map`; `field` (n^3,), `box` and `key` light the
objects as there. `palette` (L, 3) has a row per label, the first one for labels beyond.
`visibility` (n^3,) is read if `is_pale`: objects are pale where it is 0. The floor fades at `reach`
(m).
"""
varied = Kernel(
    _vary,
    _vary_all,
    types="i8, UniTuple(f4, 16), UniTuple(i8, 2), f4[::1], f4[:, ::1], i4[::1], f4, b1[::1]",
)
"""varied(rows, view, (width, height), depth, facing, labels, reach, mask): beside which pixels
something else is seen, or a line of the floor (bool). Rays went through all pixels, row by row; an
element is a row, as divisions by its length would take most of the time."""
blend = Kernel(
    _blend,
    _blend_all,
    types="i8, i8[::1], i4[::1], i8, i4[::1], f4[::1], f4[:, ::1], i4[::1], f4[::1], f4[:, ::1]",
)
"""blend(K, pixels, numbers, width, fine_labels, fine_depth, fine_colours, labels, depth, picture).

The pixels (K,) int64 of `picture` (H W, 3) become the mean of four rays (K 4, ...) each, row by
row within the pixel; a ray after which the object changes is darker. `numbers` (H W,) int32 is the
place of a pixel among those, -1 for the others, whose one ray met `labels` and `depth` (H W,).
"""
