"""The levels of detail of a height grid, and where on them a frame's pixels land."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from scenefw.core.height_maps import HeightGrid
from scenefw.core.settings import POSITIVE
from scenefw.core.types import Frame
from scenefw.kernels import triangles
from scenefw.kernels.cameras import finite, stack_cameras
from scenefw.kernels.compile import float32


@dataclass(frozen=True)
class Landed:
    """Pixels of a frame on the mesh, as the kernels that add to its vertices take them.

    Args:
        pixels: of the frame.
        arguments: bands, order, starts, work and layout, then cells and spots, of
            `kernels.triangles`.
        bands: int32 of bands that hold vertices of the pixels' triangles.
        boxes: (L, 4) int32, per level the vertices touched: first row, end, first column, end.
    """

    pixels: int
    arguments: tuple[Tensor, ...]
    bands: Tensor
    boxes: Tensor


class Pyramid:
    """A grid's levels of detail one after the other in flat tensors, finest first.

    A measurement goes to the level whose triangles cover about `a` pixels where it lies. On
    screen the triangle of the coarsest level covers d pixels, log2(d / a) halvings of area make it
    that fine, and a level has a quarter of the next one's area, so it is round(log2(d / a) / 2)
    levels finer than the coarsest: the level of thesis 4.3.1, counted in whole subdivisions.

    Args:
        grid: the finest level.
        a: pixels that a triangle should cover.
        device: of the tensors.
    """

    def __init__(self, grid: HeightGrid, a: float, device: str) -> None:
        POSITIVE.require(a=a)
        self.grid, self.a, self.device = grid, a, torch.device(device)
        padding = grid.vertices + 1
        layout, vertices, bands = [], padding, 0
        for level in range(grid.levels):
            n = (grid.vertices - 1 >> level) + 1
            layout.append((vertices, n, bands))
            vertices += n * n
            bands += -(-(n - 1) // triangles.BAND_ROWS)
            bands += bands % 2  # parity of bands goes by level
        self.vertices, self.bands, self._layout = vertices + padding, bands, layout
        self.layout = torch.tensor(layout, dtype=torch.int32, device=self.device)

    def levels(self) -> Iterator[tuple[int, int, int]]:
        """From the coarsest on: first vertex, vertices per side, those of the next coarser one."""
        below = 0
        for first, n, _ in reversed(self._layout):
            yield first, n, below
            below = n

    @property
    def finest(self) -> slice:
        """The vertices of the finest level."""
        first, n, _ = self._layout[0]
        return slice(first, first + n * n)

    def rows(self, flat: Tensor, boxes: Tensor) -> Iterator[Tensor]:
        """Views (rows, n) of the vertices of each touched level, whole bands and a row around."""
        for (first, n, _), (top, bottom, _, _) in zip(self._layout, boxes.tolist(), strict=True):
            if bottom > 0:
                margin = triangles.BAND_ROWS + 1
                begin, end = max(top - margin, 0), min(bottom + margin, n)
                yield flat[first + begin * n : first + end * n]

    def locate(self, frame: Frame) -> Landed:
        """Where the pixels of a frame land.

        Raises:
            InputError: intrinsics or a pose that no camera has.
        """
        cameras = stack_cameras([frame.camera], self.device)
        depth = finite(torch.from_numpy(np.ascontiguousarray(frame.depth)).to(self.device), 0.0)
        count = depth.numel()
        bands, cells = (torch.empty(count, dtype=torch.int32, device=self.device) for _ in range(2))
        spots = torch.empty((count, 4), dtype=torch.float32, device=self.device)
        triangles.locate(
            count, depth.view(-1), cameras.intrinsics, cameras.T_world_camera,
            self.layout, bands, cells, spots, frame.camera.width, self._box(),
        )  # fmt: skip
        return self._ordered(count, bands, cells, spots)

    def _box(self) -> tuple[np.float32, ...]:
        lower_x, lower_y = self.grid.lower
        upper_y, extent = lower_y + self.grid.extent, self.grid.extent
        return float32(lower_x, upper_y, 1 / self.grid.spacing, self.a, extent)

    def _ordered(self, count: int, bands: Tensor, cells: Tensor, spots: Tensor) -> Landed:
        order = torch.empty(count, dtype=torch.int32)
        starts = torch.empty(self.bands + 1, dtype=torch.int32)
        work = torch.empty((2, self.bands + 1), dtype=torch.int32)
        touched = torch.arange(self.bands, dtype=torch.int32)
        boxes = torch.tensor([(0, n, 0, n) for _, n, _ in self._layout], dtype=torch.int32)
        sorting = (bands, cells, self.layout, order, starts, work, touched, boxes)
        if self.device.type == "cpu":  # elsewhere threads add atomically, in no order
            touched_count = triangles.order_by_band(*(tensor.numpy() for tensor in sorting))
            touched = touched[:touched_count]
        order, starts, work, touched, boxes = (
            t.to(self.device) for t in (order, starts, work, touched, boxes)
        )
        arguments = (bands, order, starts, work, self.layout, cells, spots)
        return Landed(count, arguments, touched, boxes)
