"""Ray casting of table-top scenes: depth and labels at pixel centres, colour with shadows."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera, Frame
from scenefw.kernels import meshes, shading, textures
from scenefw.kernels.compile import float32
from scenefw.kernels.meshes import Tree

# Offsets in pixels of the further rays of a pixel, on a turned square.
_OFFSETS = ((0.125, 0.375), (-0.375, 0.125), (0.375, -0.125), (-0.125, -0.375))
_ABOVE = 0.05  # m over the highest point: where rays of maps begin
_GAMMA = 1 / 2.2

Rays: TypeAlias = Callable[[tuple[float, float], Tensor | slice], Tensor]
"""Rays (R, 6) of chosen pixels, moved by an offset in pixels."""


class MeshRaycaster:
    """Renders scenes by casting rays at their triangles and the table, the plane z = 0.

    Colour: textures by formula, the light of the room, lamps with hard shadows and highlights.
    Pixels that differ from a neighbour get four more rays, for colour alone; depth and labels are
    those of the ray through the pixel's centre. The table has no end: every pixel below the
    horizon has a depth.

    Args:
        contrast: difference of colour (0..1) to a neighbour from which a pixel gets more rays;
            1 = never.
        device: where rays are cast.

    Raises:
        ConfigError: the contrast is negative.
    """

    def __init__(self, contrast: float = 0.1, device: str = "cpu") -> None:
        if contrast < 0:
            raise ConfigError(f"contrast = {contrast}: expected 0 or more, e.g. 0.1")
        self.contrast = contrast
        self.device = torch.device(device)
        self._last: tuple[TabletopGeometry, _Prepared] | None = None

    def fingerprint(self) -> str:
        """Changes with whatever changes the images."""
        return f"MeshRaycaster {self.contrast} {_sources()}"

    def frames(self, geometry: TabletopGeometry, cameras: Sequence[Camera]) -> Iterator[Frame]:
        """One frame per camera: z-depth (0 = above the horizon), colour, class ids."""
        for camera in cameras:
            yield self._frame(geometry, camera)

    def height_map(self, geometry: TabletopGeometry, grid: HeightGrid) -> HeightMap:
        """The scene from straight above: heights, colour and labels of every vertex."""
        top = _ABOVE + float(geometry.corners[..., 2].max(initial=0.0))
        place = torch.from_numpy(grid.positions())

        def rays(offset: tuple[float, float], chosen: Tensor | slice) -> Tensor:
            shift = grid.spacing * torch.tensor([offset[0], -offset[1]])
            flat = (place.view(-1, 2)[chosen] + shift).float()
            down = torch.tensor([top, 0.0, 0.0, -1.0]).expand(len(flat), 4)
            return torch.cat([flat, down], dim=1).to(self.device).contiguous()

        picture = _Picture(self._prepared(geometry), rays, grid.shape, (grid.spacing, 0.0))
        distance, labels, colour = picture.render(self.contrast)
        return HeightMap(
            grid,
            (top - distance).clip(min=0),
            colour,
            np.ones(grid.shape, dtype=np.float32),
            np.zeros(grid.shape, dtype=np.float32),
            labels=labels,
            classes=geometry.classes,
        )

    def _frame(self, geometry: TabletopGeometry, camera: Camera) -> Frame:
        pose = torch.from_numpy(np.asarray(camera.T_world_camera, dtype=np.float64))
        v, u = torch.meshgrid(
            torch.arange(camera.height), torch.arange(camera.width), indexing="ij"
        )
        pixels = torch.stack([u, v], dim=-1).view(-1, 2).double()
        centre = torch.tensor([camera.cx, camera.cy], dtype=torch.float64)
        focal = torch.tensor([camera.fx, camera.fy], dtype=torch.float64)

        def rays(offset: tuple[float, float], chosen: Tensor | slice) -> Tensor:
            ahead = (pixels[chosen] + torch.tensor(offset) - centre) / focal
            direction = ahead @ pose[:3, :2].T + pose[:3, 2]  # of length 1 along the optical axis
            origin = pose[:3, 3].expand_as(direction)
            return torch.cat([origin, direction], dim=1).float().to(self.device).contiguous()

        shape = (camera.height, camera.width)
        picture = _Picture(self._prepared(geometry), rays, shape, (0.0, 1 / camera.fx))
        depth, labels, colour = picture.render(self.contrast)
        return Frame(depth, camera, colour, labels, geometry.name)

    def _prepared(self, geometry: TabletopGeometry) -> _Prepared:
        """The tree of the scene that was rendered last is kept."""
        if self._last is None or self._last[0] is not geometry:
            self._last = (geometry, _Prepared(geometry, self.device))
        return self._last[1]


class _Prepared:
    """A scene as tensors: its tree, what belongs to each triangle, and the rest."""

    def __init__(self, geometry: TabletopGeometry, device: torch.device) -> None:
        self.device = device
        self.tree = Tree(geometry.corners, device)
        order = self.tree.order
        self.item_of = self._tensor(geometry.item_of[order])
        self.rows = (
            self._tensor(geometry.normals[order].reshape(-1, 9)),
            self._tensor(geometry.colours[order]),
            self._tensor(geometry.texture_of[order]),
            self.item_of,
        )
        self.scene = tuple(
            self._tensor(array)
            for array in (geometry.placements, geometry.textures, geometry.surface,
                          geometry.lights.reshape(-1, 6), geometry.ambient)
        )  # fmt: skip
        labels = geometry.labels[geometry.item_of[order]]
        self.labels = self._tensor(np.concatenate([labels, [-1, 0]]).astype(np.int32))

    def _tensor(self, array: NDArray) -> Tensor:
        return torch.from_numpy(np.ascontiguousarray(array)).to(self.device)

    def cast(self, rays: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        return self.tree.cast(rays, table=True)

    def colour(
        self, rays: Tensor, hits: tuple[Tensor, Tensor, Tensor], width: tuple[float, float]
    ) -> Tensor:
        tree, found = self.tree, torch.empty(len(rays), 3, device=rays.device)
        shading.shade(
            len(rays), tree.bounds, tree.links, tree.triangles, rays, *hits, *self.rows,
            *self.scene, *float32(*width), found,
        )  # fmt: skip
        return found.clamp_(0, 1)

    def label(self, hit: Tensor) -> Tensor:
        """Class ids; TABLE and NOTHING count from the end of the list."""
        return self.labels[torch.where(hit < 0, hit + len(self.labels), hit).long()]


class _Picture:
    """Rays of an image or a map, through pixel centres and beside them."""

    def __init__(
        self, scene: _Prepared, rays: Rays, shape: tuple[int, int], width: tuple[float, float]
    ) -> None:
        self.scene, self.rays, self.shape, self.width = scene, rays, shape, width

    def render(self, contrast: float) -> tuple[NDArray, NDArray, NDArray]:
        """Distance along the rays, labels, colour."""
        rays = self.rays((0.0, 0.0), slice(None))
        hits = self.scene.cast(rays)
        colour = self.scene.colour(rays, hits, self.width)
        if contrast < 1:
            self._refine(colour, contrast)
        shown = (colour**_GAMMA * 255).round().to(torch.uint8)
        return (
            hits[0].view(self.shape).cpu().numpy(),
            self.scene.label(hits[1]).view(self.shape).cpu().numpy(),
            shown.view(*self.shape, 3).cpu().numpy(),
        )

    def _refine(self, colour: Tensor, contrast: float) -> None:
        chosen = _edges((colour**_GAMMA).view(*self.shape, 3), contrast)
        beside = torch.cat([self.rays(offset, chosen.cpu()) for offset in _OFFSETS])
        found = self.scene.colour(beside, self.scene.cast(beside), self.width)
        total = found.view(len(_OFFSETS), -1, 3).sum(dim=0) + colour[chosen]
        colour[chosen] = total / (1 + len(_OFFSETS))


def _edges(image: Tensor, contrast: float) -> Tensor:
    """Flat indices of pixels that differ from one of their four neighbours."""
    marked = torch.zeros(image.shape[:2], dtype=torch.bool, device=image.device)
    across = (image[:, 1:] - image[:, :-1]).abs().amax(-1) > contrast
    down = (image[1:] - image[:-1]).abs().amax(-1) > contrast
    marked[:, 1:] |= across
    marked[:, :-1] |= across
    marked[1:] |= down
    marked[:-1] |= down
    return marked.view(-1).nonzero()[:, 0]


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of the code that decides what images look like."""
    digest = hashlib.sha256()
    for path in (meshes.__file__, shading.__file__, textures.__file__, __file__):
        digest.update(Path(str(path)).read_bytes())
    return digest.hexdigest()[:16]
