"""Table-top scenes that stay on a device, and pictures of many of them at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.height_maps import HeightGrid
from scenefw.core.tabletop import PLACEMENT, TEXTURE, TabletopGeometry
from scenefw.core.types import Float64
from scenefw.kernels import pictures
from scenefw.kernels.compile import float32
from scenefw.kernels.meshes import build_tree
from scenefw.kernels.pictures import GAMMA

LENS = 20
"""Numbers of a lens, see `kernels.pictures`."""

_ABOVE = 0.05  # m over the highest point: where rays of maps begin


@dataclass(frozen=True, eq=False)
class PreparedTable:
    """A scene as kernels read it, in memory of the host; quick to send between processes.

    Args:
        arrays: by name, in the order of the kernels' arguments.
        order: (F,) row of the geometry of each row of triangles.
        top: where rays of maps begin (m).
    """

    arrays: dict[str, NDArray]
    order: NDArray[np.int64]
    top: float


@dataclass(frozen=True)
class Pictures:
    """What B lenses show.

    Args:
        distance: (B, H, W) float32 lengths of rays, which are z-depths of cameras (m), 0 = nothing.
        labels: (B, H, W) int8 class ids, -1 = nothing.
        colour: (B, H, W, 3) float32, 0 to 1, as in images.
    """

    distance: Tensor
    labels: Tensor
    colour: Tensor


def prepared(geometry: TabletopGeometry) -> PreparedTable:
    """Builds the tree of a scene and sorts all else by it."""
    bounds, links, triangles, order = build_tree(geometry.corners)
    item = geometry.item_of[order]
    looks = np.stack([geometry.texture_of[order], item, geometry.labels[item]], axis=-1)
    lights = geometry.lights.reshape(-1, 6)
    arrays = {
        "bounds": bounds,
        "links": links,
        "triangles": triangles,
        "normals": geometry.normals[order].reshape(-1, 9),
        "colours": geometry.colours[order],
        "looks": looks.astype(np.int32).reshape(-1, 3),
        "placements": geometry.placements.reshape(-1, PLACEMENT),
        "textures": geometry.textures.reshape(-1, TEXTURE),
        "lights": lights,
        "surfaces": np.concatenate([geometry.surface, geometry.ambient])[None],
        "scenes": np.array([[0, len(links), 0, 0, len(lights)]], dtype=np.int32),
    }
    top = _ABOVE + float(geometry.corners[..., 2].max(initial=0.0))
    return PreparedTable({n: np.ascontiguousarray(a) for n, a in arrays.items()}, order, top)


class Tables:
    """Scenes on a device, about 3 MB each, that are looked at in batches.

    Args:
        scenes: prepared.
        device: where they stay.
        contrast: difference of colour (0..1) to a neighbour from which a pixel gets four more rays
            for its colour; 1 = never.
    """

    def __init__(
        self, scenes: Sequence[PreparedTable], device: torch.device | str, contrast: float = 0.1
    ) -> None:
        self.device, self.contrast = torch.device(device), contrast
        self.tops = np.array([scene.top for scene in scenes])
        self._arrays = [torch.from_numpy(array).to(device) for array in _join(scenes)]

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.tops)

    def render(self, scenes: Tensor, lenses: Tensor, size: tuple[int, int]) -> Pictures:
        """One picture per lens; nothing waits for the device.

        Args:
            scenes: (B,) int32 numbers of scenes, on the device.
            lenses: (B, LENS) float64, on the device.
            size: width and height (pixels).
        """
        shape = (len(scenes), size[1], size[0])
        count = len(scenes) * size[0] * size[1]
        distance = torch.empty(count, device=self.device)
        label = torch.empty(count, dtype=torch.int8, device=self.device)
        colour = torch.empty(count, 3, device=self.device)
        where = (*self._arrays, scenes, lenses, size)
        pictures.look(count, *where, distance, label, colour)
        tone = colour**GAMMA
        if self.contrast < 1:
            refined = torch.empty_like(tone)
            pictures.refine(count, *where, colour, tone, *float32(self.contrast), refined)
            tone = refined
        return Pictures(distance.view(shape), label.view(shape), tone.view(*shape, 3))


def camera_lenses(intrinsics: Float64, poses: Float64) -> Float64:
    """Lenses (B, LENS) of cameras with fx, fy, cx, cy (B, 4) and `T_world_camera` (B, 4, 4)."""
    fx, fy, cx, cy = intrinsics.T[..., None]
    right, down, ahead, eye = (poses[:, :3, k] for k in range(4))
    still, width = np.zeros_like(eye), np.column_stack([np.zeros(len(poses)), 1 / fx])
    middle = ahead - right * cx / fx - down * cy / fy
    return np.concatenate([eye, still, still, middle, right / fx, down / fy, width], axis=1)


def map_lens(grid: HeightGrid, top: float, row: int = 0, column: int = 0) -> Float64:
    """Lens (LENS,) of vertices from above, the first pixel at a row and column of the grid."""
    step = grid.spacing
    x, y = grid.lower[0] + column * step, grid.lower[1] + grid.extent - row * step
    return np.array([x, y, top, step, 0, 0, 0, -step, 0, 0, 0, -1, *[0] * 6, step, 0], float)


def _join(scenes: Sequence[PreparedTable]) -> list[NDArray]:
    """Arrays of all scenes, one after the other, with what points into them moved."""
    parts: dict[str, list[NDArray]] = {name: [] for name in scenes[0].arrays}
    ends = dict.fromkeys(parts, 0)
    for scene in scenes:
        for name, array in scene.arrays.items():
            parts[name].append(array + _shift(name, ends))
        for name, array in scene.arrays.items():
            ends[name] += len(array)
    return [np.concatenate(arrays) for arrays in parts.values()]


def _shift(name: str, ends: dict[str, int]) -> NDArray:
    """What to add to each column of an array when scenes are put one behind the other.

    Some columns are row numbers in another array of the same scene. These grow by the rows that
    this other array already has from the scenes before; all else stays.

    Args:
        name: of the array.
        ends: rows of each array so far.
    """
    points_to = {
        "links": ("links", "triangles", None),
        "looks": ("textures", "placements", None),
        "scenes": ("links", "links", "textures", "lights", "lights"),
    }
    if name not in points_to:
        return np.zeros((), dtype=np.float32)
    return np.array([ends[to] if to else 0 for to in points_to[name]], dtype=np.int32)
