"""A height map as a surface to look at in 3D, its vertices' values as a picture on it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.report.labelling.pictures import (
    colour_picture,
    height_picture,
    label_picture,
    source_picture,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import trimesh
    from numpy.typing import NDArray

    from scenefw.report.pictures import Picture

_LARGEST = 600  # vertices per side of what is kept of a map
_MESH = 300  # and of its surface

_PICTURES: dict[str, tuple[Callable[[HeightMap], bool], Callable[[HeightMap], Picture]]] = {
    "labels": (
        lambda height_map: height_map.labels is not None,
        lambda height_map: label_picture(np.asarray(height_map.labels), len(height_map.classes)),
    ),
    "colour": (lambda _: True, colour_picture),
    "height": (lambda _: True, height_picture),
    "labels come from": (
        lambda height_map: height_map.sources is not None,
        lambda height_map: source_picture(np.asarray(height_map.sources, np.uint8)),
    ),
}


def looks(height_map: HeightMap) -> list[str]:
    """What the surface of a map can show."""
    return [name for name, (is_available, _) in _PICTURES.items() if is_available(height_map)]


def reduced(height_map: HeightMap, largest: int = _LARGEST) -> HeightMap:
    """Every n-th vertex of a map, without probabilities, so that many of them fit into memory.

    Args:
        height_map: the map.
        largest: vertices per side that it may have.
    """
    step = 1
    while (height_map.grid.vertices - 1) // step + 1 > largest and (
        (height_map.grid.vertices - 1) % (2 * step) == 0
    ):
        step *= 2
    grid = height_map.grid
    vertices = (grid.vertices - 1) // step + 1
    subsample = np.s_[::step, ::step]
    labels, sources = height_map.labels, height_map.sources
    return replace(
        height_map,
        grid=HeightGrid(vertices, grid.extent, grid.lower, levels=1),
        heights=height_map.heights[subsample].copy(),
        colour=height_map.colour[subsample].copy(),
        confidence=height_map.confidence[subsample].copy(),
        variance=height_map.variance[subsample].copy(),
        probabilities=None,
        labels=None if labels is None else labels[subsample].copy(),
        sources=None if sources is None else sources[subsample].copy(),
    )


def surface(height_map: HeightMap, look: str) -> trimesh.Trimesh:
    """The seen surface (m), with a picture of one of its `looks` on it; empty if nothing is seen.

    Args:
        height_map: the map.
        look: one of `looks`.
    """
    import trimesh

    coarse = reduced(height_map, _MESH)
    grid, observed = coarse.grid, coarse.seen
    corners = _corners(observed)
    vertex_ids, faces = np.unique(corners, return_inverse=True)
    positions = np.concatenate(
        [grid.positions(), np.nan_to_num(coarse.heights)[..., None]], axis=-1
    ).reshape(-1, 3)[vertex_ids]
    across = (positions[:, :2] - grid.lower) / grid.extent
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=_image(_PICTURES[look][1](height_map)),
        metallicFactor=0.0,
        roughnessFactor=1.0,
        doubleSided=True,
    )
    return trimesh.Trimesh(
        positions.astype(np.float32),
        faces.reshape(-1, 3),
        visual=trimesh.visual.TextureVisuals(uv=across, material=material),
        process=False,
    )


def _corners(observed: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Vertices (F, 3) of two triangles for each cell all of whose corners are seen."""
    index = np.arange(observed.size).reshape(observed.shape)
    cell_mask = observed[:-1, :-1] & observed[:-1, 1:] & observed[1:, :-1] & observed[1:, 1:]
    a, b = index[:-1, :-1][cell_mask], index[:-1, 1:][cell_mask]
    c, d = index[1:, :-1][cell_mask], index[1:, 1:][cell_mask]
    return np.concatenate([np.stack([a, c, b], axis=1), np.stack([b, c, d], axis=1)])


def _image(picture: Picture) -> Image.Image:
    return Image.fromarray(np.rint(255 * np.clip(picture, 0, 1)).astype(np.uint8))
