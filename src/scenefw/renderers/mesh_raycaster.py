"""Ray casting of table-top scenes: depth and labels at pixel centres, colour with shadows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.settings import NOT_NEGATIVE
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera, Frame
from scenefw.kernels import meshes, pictures, shading, textures
from scenefw.renderers import tables
from scenefw.renderers.tables import Tables


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
        NOT_NEGATIVE.require(contrast=contrast)
        self.contrast = contrast
        self.device = torch.device(device)
        self._last: tuple[TabletopGeometry, Tables] | None = None

    def fingerprint(self) -> str:
        """Changes with whatever changes the images."""
        return f"MeshRaycaster {self.contrast} {_sources()}"

    def tables(
        self, scenes: Sequence[tables.PreparedTable], device: torch.device | str | None = None
    ) -> Tables:
        """Scenes that stay on a device (default: this renderer's), looked at in batches."""
        return Tables(scenes, device or self.device, self.contrast)

    def frames(self, geometry: TabletopGeometry, cameras: Sequence[Camera]) -> Iterator[Frame]:
        """One frame per camera: z-depth (0 = above the horizon), colour, class ids."""
        scene = self._table(geometry)
        for camera in cameras:
            lens = np.array([[camera.fx, camera.fy, camera.cx, camera.cy]], dtype=np.float64)
            pose = np.asarray(camera.T_world_camera, dtype=np.float64)[None]
            size = (camera.width, camera.height)
            depth, labels, colour = _render(scene, tables.camera_lenses(lens, pose), size)
            yield Frame(depth, camera, colour, labels, geometry.name)

    def height_map(self, geometry: TabletopGeometry, grid: HeightGrid) -> HeightMap:
        """The scene from straight above: heights, colour and labels of every vertex."""
        scene = self._table(geometry)
        top, size = float(scene.tops[0]), (grid.vertices, grid.vertices)
        distance, labels, colour = _render(scene, tables.map_lens(grid, top)[None], size)
        return HeightMap(
            grid,
            (np.float32(top) - distance).clip(min=0),
            colour,
            np.ones(grid.shape, dtype=np.float32),
            np.zeros(grid.shape, dtype=np.float32),
            labels=labels,
            classes=geometry.classes,
        )

    def _table(self, geometry: TabletopGeometry) -> Tables:
        """The scene that was rendered last is kept."""
        if self._last is None or self._last[0] is not geometry:
            self._last = (geometry, self.tables([tables.prepared(geometry)]))
        return self._last[1]


def image(colour: Tensor) -> Tensor:
    """Colours 0 to 1 as images hold them, uint8."""
    return (colour * 255).round().to(torch.uint8)


def _render(
    scene: Tables, lenses: NDArray[np.float64], size: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.uint8]]:
    """Distances, labels and colour of a picture of the first scene, on the host."""
    first = torch.zeros(1, dtype=torch.int32, device=scene.device)
    picture = scene.render(first, torch.from_numpy(lenses).to(scene.device), size)
    return (
        picture.distance[0].cpu().numpy(),
        picture.labels[0].int().cpu().numpy(),
        image(picture.colour[0]).cpu().numpy(),
    )


@lru_cache(maxsize=1)
def _sources() -> str:
    """Digest of the code that decides what images look like."""
    digest = hashlib.sha256()
    for module in (meshes, shading, textures, pictures, tables):
        digest.update(Path(str(module.__file__)).read_bytes())
    digest.update(Path(__file__).read_bytes())
    return digest.hexdigest()[:16]
