"""Pictures of scenes of triangles, of all images of a batch at once, one pixel per element.

Image b shows scene `scene_indices[b]` through `lenses[b]`, 20 float64: the ray of pixel (u, v)
begins at p + u p_u + v p_v and goes along d + u d_u + v d_v (p, p_u, p_v, d, d_u, d_v, three each),
and a pixel is `base + spread * distance` wide (the last two). Cameras and maps from above are both
such lenses. Images are flat, B images of height rows one after the other; `size` is (width,
height).
Arrays of scenes are those of `shading`.
"""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

from __future__ import annotations

import numpy as np
from numba import prange

from scenefw.kernels.compile import Kernel, element, loop
from scenefw.kernels.meshes import BLOCK, LANES, TABLE, first_hit
from scenefw.kernels.shading import shaded

_ZERO, _ONE = np.float32(0), np.float32(1)
_FIFTH = np.float32(0.2)
GAMMA = 1 / 2.2
"""Exponent from linear colour to what images hold."""
_GAMMA = np.float32(GAMMA)
_ACROSS, _DOWN = 0.125, 0.375  # pixels to the first further ray of four on a turned square


@element
def _along(lenses, image, first, u, v):
    """A point or a direction of a lens at a pixel."""
    x = lenses[image, first] + u * lenses[image, first + 3] + v * lenses[image, first + 6]
    y = lenses[image, first + 1] + u * lenses[image, first + 4] + v * lenses[image, first + 7]
    z = lenses[image, first + 2] + u * lenses[image, first + 5] + v * lenses[image, first + 8]
    return np.float32(x), np.float32(y), np.float32(z)


@element
def _limited(x):
    return max(_ZERO, min(_ONE, x))


@element
def _see(
    bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
    scenes, scene_indices, lenses, image, u, v,
):  # fmt: skip
    """What is hit at a place of an image, how far away, and its linear colour."""
    scene = scene_indices[image]
    origin, ahead = _along(lenses, image, 0, u, v), _along(lenses, image, 9, u, v)
    hit = first_hit(
        bounds, links, triangles, scenes[scene, 0], scenes[scene, 1], True,
        origin[0], origin[1], origin[2], ahead[0], ahead[1], ahead[2],
    )  # fmt: skip
    width = np.float32(lenses[image, 18]) + np.float32(lenses[image, 19]) * hit[1]
    red, green, blue = shaded(
        bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
        scenes, scene, origin, ahead, hit, width,
    )  # fmt: skip
    return hit[0], hit[1], _limited(red), _limited(green), _limited(blue)


@element
def _look(
    i, bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
    scenes, scene_indices, lenses, size, distance, label, colour,
):  # fmt: skip
    width, height = size
    row, u = i // width, i % width
    image, v = row // height, row % height
    hit, distance[i], colour[i, 0], colour[i, 1], colour[i, 2] = _see(
        bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
        scenes, scene_indices, lenses, image, np.float64(u), np.float64(v),
    )  # fmt: skip
    label[i] = looks[hit, 2] if hit >= 0 else (0 if hit == TABLE else -1)


@loop
def _look_all(
    count, bounds, links, triangles, normals, colours, looks, placements, textures, lights,
    surfaces, scenes, scene_indices, lenses, size, distance, label, colour,
):  # fmt: skip
    for lane in prange(LANES):
        for start in range(np.int64(lane) * BLOCK, count, LANES * BLOCK):
            for i in range(start, min(start + BLOCK, count)):
                _look(
                    i, bounds, links, triangles, normals, colours, looks, placements, textures,
                    lights, surfaces, scenes, scene_indices, lenses, size, distance, label, colour,
                )  # fmt: skip


@element
def _differ(tone, first, second, contrast):
    difference = abs(tone[first, 0] - tone[second, 0])
    difference = max(difference, abs(tone[first, 1] - tone[second, 1]))
    return max(difference, abs(tone[first, 2] - tone[second, 2])) > contrast


@element
def _is_edge(tone, i, u, v, size, contrast):
    """Whether a pixel differs from one of its four neighbours."""
    width, height = size
    return (
        (u > 0 and _differ(tone, i, i - 1, contrast))
        or (u < width - 1 and _differ(tone, i, i + 1, contrast))
        or (v > 0 and _differ(tone, i, i - width, contrast))
        or (v < height - 1 and _differ(tone, i, i + width, contrast))
    )


@element
def _refine(
    i, bounds, links, triangles, normals, colours, looks, placements, textures, lights, surfaces,
    scenes, scene_indices, lenses, size, colour, tone, contrast, refined,
):  # fmt: skip
    width, height = size
    row, u = i // width, i % width
    image, v = row // height, row % height
    if not _is_edge(tone, i, u, v, size, contrast):
        refined[i, 0], refined[i, 1], refined[i, 2] = tone[i, 0], tone[i, 1], tone[i, 2]
        return
    red, green, blue = colour[i, 0], colour[i, 1], colour[i, 2]
    across, down = _ACROSS, _DOWN
    for _ in range(4):
        _, _, more_red, more_green, more_blue = _see(
            bounds, links, triangles, normals, colours, looks, placements, textures, lights,
            surfaces, scenes, scene_indices, lenses, image, u + across, v + down,
        )  # fmt: skip
        red, green, blue = red + more_red, green + more_green, blue + more_blue
        across, down = -down, across
    refined[i, 0] = (red * _FIFTH) ** _GAMMA
    refined[i, 1] = (green * _FIFTH) ** _GAMMA
    refined[i, 2] = (blue * _FIFTH) ** _GAMMA


@loop
def _refine_all(
    count, bounds, links, triangles, normals, colours, looks, placements, textures, lights,
    surfaces, scenes, scene_indices, lenses, size, colour, tone, contrast, refined,
):  # fmt: skip
    for lane in prange(LANES):
        for start in range(np.int64(lane) * BLOCK, count, LANES * BLOCK):
            for i in range(start, min(start + BLOCK, count)):
                _refine(
                    i, bounds, links, triangles, normals, colours, looks, placements, textures,
                    lights, surfaces, scenes, scene_indices, lenses, size, colour, tone, contrast,
                    refined,
                )  # fmt: skip


look = Kernel(_look, _look_all)
"""look(pixels, scenes..., scene_indices, lenses, size, distance, label, colour): through pixel
centres.

`distance` counts in lengths of the direction, 0 where nothing is hit; `label` is int8, -1 there;
`colour` (pixels, 3) is linear, 0 to 1.
"""
refine = Kernel(_refine, _refine_all)
"""refine(pixels, scenes..., scene_indices, lenses, size, colour, tone, contrast, refined): smooth
edges.

`tone` is `colour` ** GAMMA. Pixels whose tone differs from a neighbour's by more than `contrast`
get four more rays; `refined` (pixels, 3) is the tone of their mean.
"""
