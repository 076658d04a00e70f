"""Height maps as surfaces: empty maps, and what a camera sees of a map."""

import numpy as np
import torch

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labels import UNKNOWN
from scenefw.core.types import Camera, Frame
from scenefw.kernels.cameras import finite, stack_cameras
from scenefw.kernels.compile import float32
from scenefw.kernels.triangles import UNSEEN
from scenefw_painting.height_fields import cast

_MARGIN = 1e-6  # metres about the lowest and the highest vertex: flat maps have some thickness


def empty(grid: HeightGrid) -> HeightMap:
    """A map with nothing seen yet."""
    unseen = np.full(grid.shape, np.nan, np.float32)
    colour = np.zeros((*grid.shape, 3), np.uint8)
    return HeightMap(grid, unseen, colour, np.zeros(grid.shape, np.float32), unseen.copy())


def view(height_map: HeightMap, camera: Camera, name: str = "") -> Frame:
    """Depth, colour and labels that a camera sees of the map's triangles, from the nearest vertex.

    Where a ray meets no triangle of three seen vertices the depth is 0, the colour black and the
    label unknown; labels are None for a map without.

    Raises:
        InputError: intrinsics or a pose that no camera has.
    """
    cameras, grid = stack_cameras([camera]), height_map.grid
    count = camera.width * camera.height
    depth, vertices = torch.zeros(count), torch.full((count,), -1, dtype=torch.int32)
    if height_map.seen.any():
        heights = torch.from_numpy(np.ascontiguousarray(height_map.heights, dtype=np.float32))
        low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
        finite_heights = finite(heights, float(UNSEEN))
        box = (grid.lower[0], grid.lower[1] + grid.extent, 1 / grid.spacing)
        cast(
            count, cameras.intrinsics, cameras.T_world_camera, finite_heights.view(-1),
            depth, vertices, camera.width, grid.vertices,
            float32(*box, low - _MARGIN, high + _MARGIN),
        )  # fmt: skip
    shape = (camera.height, camera.width)
    hit, vertex_ids = depth.numpy().reshape(shape), vertices.numpy().reshape(shape)
    met = vertex_ids >= 0
    colour = np.where(met[..., None], height_map.colour.reshape(-1, 3)[vertex_ids], 0).astype(
        np.uint8
    )
    labels = None
    if height_map.labels is not None:
        labels = np.where(met, height_map.labels.reshape(-1)[vertex_ids], UNKNOWN).astype(np.int32)
    return Frame(hit, camera, colour, labels, name)
