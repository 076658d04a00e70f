"""Textures by formula as colours of points, for renderers that know no such formulas."""

from __future__ import annotations

import dataclasses

import numpy as np
import torch
from numpy.typing import NDArray

from scenefw.core.tabletop import PLAIN, TabletopGeometry
from scenefw.kernels import shading
from scenefw.kernels.compile import float32
from scenefw.kernels.meshes import TABLE
from scenefw.renderers.tables import prepared

Array = NDArray[np.float32]

_DETAIL = 1e-3  # m: finer patterns fade


def colour_of_points(geometry: TabletopGeometry, points: Array, face: NDArray[np.int32]) -> Array:
    """Linear colours (P, 3) at points (P, 3) of faces (P,); TABLE is the table."""
    scene = prepared(geometry)
    row = np.empty(len(scene.order) + 1, dtype=np.int32)
    row[scene.order] = np.arange(len(scene.order))
    row[TABLE] = TABLE
    names = ("colours", "looks", "placements", "textures", "surfaces", "scenes")
    arrays = [torch.from_numpy(scene.arrays[name]) for name in names]
    colour = torch.empty(len(points), 3)
    where = (torch.from_numpy(points.astype(np.float32)), torch.from_numpy(row[face]))
    shading.paint(len(points), *arrays, *where, *float32(_DETAIL), colour)
    colours: Array = colour.numpy()
    return colours.clip(0, 1)


def table_image(geometry: TabletopGeometry, half: float, pixels: int) -> Array:
    """Linear colours (N, N, 3) of the table in +-half metres, row 0 at the greatest y."""
    along = (np.arange(pixels) + 0.5) / pixels * 2 * half - half
    x, y = np.meshgrid(along, -along)
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    face = np.full(len(points), TABLE, dtype=np.int32)
    return colour_of_points(geometry, points.astype(np.float32), face).reshape(pixels, pixels, 3)


def refined(geometry: TabletopGeometry, longest: float) -> tuple[TabletopGeometry, NDArray]:
    """Textured triangles split until no side exceeds `longest` (m); the old face of each new one.

    So colours of corners show the texture.
    """
    parent = np.arange(len(geometry.corners))
    corners, normals = geometry.corners, geometry.normals
    textured = geometry.textures[geometry.texture_of, 0] != PLAIN
    while True:
        side = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=-1)
        large = (side > longest) & textured[parent]
        if not large.any():
            break
        corners = np.concatenate([corners[~large], _quarters(corners[large])])
        split = _quarters(normals[large])
        split /= np.maximum(np.linalg.norm(split, axis=-1, keepdims=True), 1e-9)
        normals = np.concatenate([normals[~large], split])
        parent = np.concatenate([parent[~large], np.tile(parent[large], 4)])
    finer = dataclasses.replace(
        geometry, corners=corners.astype(np.float32), normals=normals.astype(np.float32),
        colours=geometry.colours[parent], texture_of=geometry.texture_of[parent],
        item_of=geometry.item_of[parent],
    )  # fmt: skip
    return finer, parent


def _quarters(triangles: Array) -> Array:
    a, b, c = np.moveaxis(triangles, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.concatenate([np.stack(part, axis=1) for part in parts])
