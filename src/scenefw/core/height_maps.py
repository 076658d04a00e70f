"""Data of height maps that crosses floors: the grid of vertices over the table, the map on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError
from scenefw.core.types import Float32, Float64, Int32


@dataclass(frozen=True)
class HeightGrid:
    """A square of V x V vertices over the table, seen from above: x to the right, y up.

    Vertex (row, column) lies at x = lower[0] + column * spacing, y = lower[1] + extent - row *
    spacing, so that maps saved as images are not mirrored.

    Args:
        vertices: per side, 2^(levels - 1) n + 1.
        extent: side of the square (m).
        lower: least x and y (m).
        levels: of detail; level l has every 2^l-th vertex.
    """

    vertices: int = 1025
    extent: float = 1.024
    lower: tuple[float, float] = (-0.512, -0.512)
    levels: int = 6

    def __post_init__(self) -> None:
        coarsest = 1 << max(self.levels - 1, 0)
        if self.levels < 1 or self.vertices <= coarsest or (self.vertices - 1) % coarsest:
            raise ConfigError(
                f"a height map of {self.vertices} vertices has no {self.levels} levels of detail; "
                f"give a multiple of {coarsest} plus one, e.g. 1025 vertices for 6 levels"
            )
        if not self.extent > 0:
            raise ConfigError(f"a height map's extent is {self.extent}, expected metres > 0")
        object.__setattr__(self, "lower", tuple(float(x) for x in self.lower))

    @property
    def spacing(self) -> float:
        """Distance between neighbouring vertices (m)."""
        return self.extent / (self.vertices - 1)

    @property
    def shape(self) -> tuple[int, int]:
        """(V, V): rows, columns."""
        return (self.vertices, self.vertices)

    def positions(self) -> Float64:
        """World x and y of all vertices, (V, V, 2)."""
        along = np.arange(self.vertices) * self.spacing
        x, y = np.meshgrid(along + self.lower[0], self.lower[1] + self.extent - along)
        return np.stack([x, y], axis=-1)

    def to_vertices(self, points: Float64) -> Float64:
        """Continuous (row, column) (..., 2) of world points (..., 2 or 3)."""
        points = np.asarray(points)
        column = (points[..., 0] - self.lower[0]) / self.spacing
        row = (self.lower[1] + self.extent - points[..., 1]) / self.spacing
        return np.stack([row, column], axis=-1)


@dataclass(frozen=True)
class HeightMap:
    """One height per vertex of a grid over the table, with colour, labels and more.

    Args:
        grid: where the vertices are.
        heights: (V, V) float32 metres above the table, NaN = unseen.
        colour: (V, V, 3) uint8, 0 where unseen.
        confidence: (V, V) float32, sum of the weights of measurements, 0 where unseen.
        variance: (V, V) float32 m^2 of the measurements about the height, NaN where unseen.
        probabilities: (C, V, V) float32 of the classes, uniform where unknown; or None.
        labels: (V, V) int32 class ids, -1 = unknown; or None.
        sources: (V, V) uint8, where the label comes from (`core.labels`); or None.
        classes: names by class id.
    """

    grid: HeightGrid
    heights: Float32
    colour: NDArray[np.uint8]
    confidence: Float32
    variance: Float32
    probabilities: Float32 | None = None
    labels: Int32 | None = None
    sources: NDArray[np.uint8] | None = None
    classes: tuple[str, ...] = ()

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(V, V) whether a vertex has a height."""
        return np.isfinite(self.heights)
