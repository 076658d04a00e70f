"""A raster of cells on the floor, to reason about tables and groups of objects from above."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core.geometry import within

CELL = 0.02
"""m: side of a cell."""

GAP = 2
"""Cells: so far what nobody sees interrupts a surface, or an object reaches over its edge."""


class FloorRaster:
    """Square cells on the floor around the z axis.

    Args:
        reach: the raster covers -reach..reach along x and y (m).
        cell: side of a cell (m).
    """

    def __init__(self, reach: float = 3.0, cell: float = CELL) -> None:
        self.reach = reach
        self.cell = cell
        self.side = round(2 * reach / cell)

    def count(self, points: NDArray[np.float64], weights: NDArray | None = None) -> NDArray:
        """Number of points (N, 3), or sum of their weights (N,), per cell, (side, side)."""
        cells = self.numbers(points)
        inside = cells >= 0
        inside_weights = None if weights is None else weights[inside]
        counts = np.bincount(cells[inside], inside_weights, minlength=self.side**2)
        return counts.reshape(self.side, self.side)

    def look_up(self, values: NDArray, points: NDArray[np.float64]) -> NDArray:
        """Value of the cell below each point (..., 3); 0 outside the raster and for NaN."""
        inside, cells = self._cells(points)
        return np.where(inside, values[cells[..., 0], cells[..., 1]], 0)

    def numbers(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Number (...) of the cell below each point (..., 3), row by row; -1 outside the raster."""
        inside, cells = self._cells(points)
        return np.where(inside, cells[..., 0] * self.side + cells[..., 1], -1)

    def centres(self, mask: NDArray[np.bool_]) -> NDArray[np.float64]:
        """World x and y (N, 2) of the centres of cells in a mask (side, side)."""
        cells: NDArray[np.float64] = np.argwhere(mask).astype(np.float64)
        return (cells + 0.5) * self.cell - self.reach

    def _cells(self, points: NDArray[np.float64]) -> tuple[NDArray, NDArray]:
        """Whether each point is over the raster, and its cell (..., 2), (0, 0) if not."""
        scaled = np.floor((points[..., :2] + self.reach) / self.cell)
        inside = within(scaled, (0, 0), (self.side - 1,) * 2)
        return inside, np.where(inside[..., None], scaled, 0).astype(np.int64)
