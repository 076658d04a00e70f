"""Which of the regions that meet in an image are one object."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.settings import FINITE
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw.perception.segmentation.regions import along_borders

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Int32


@dataclass(frozen=True, eq=False)
class RegionMerging:
    """Joins neighbouring regions that are more probably one object than two, the surest pair first.

    The log odds are a logistic regression on what is measured of a pair: the mean log odds of the
    network along its border; whether jumps of depth and creases, without learning, leave both in
    one part; and the size of the smaller, as small regions are mostly pieces of something. After
    each pair the rest is measured anew (agglomerative clustering of a region adjacency graph).

    Args:
        creases: cuts the image without learning.
        intercept: log odds, as are the others.
        affinity: by each of the mean along the border.
        same_part: if most pixels of both lie in one part of `creases`.
        log_pixels: by each factor e of the smaller region's pixels (of the thinned image).

    Raises:
        ConfigError: a number that isn't finite, or no `creases`.
    """

    creases: CreaseSegmentation = field(default_factory=CreaseSegmentation)
    intercept: float = 2.35
    affinity: float = 1.03
    same_part: float = 1.28
    log_pixels: float = -0.39

    def __post_init__(self) -> None:
        FINITE.require(intercept=self.intercept, affinity=self.affinity)
        FINITE.require(same_part=self.same_part, log_pixels=self.log_pixels)
        if self.creases is None:
            raise ConfigError(
                "creases is null; segmentation.merging.same_part=0 leaves out what they say"
            )

    def merged(
        self, regions: Int32, across: Float64, down: Float64, parts: Int32
    ) -> NDArray[np.int64]:
        """Regions (H, W), 0 = none, after joining; the arguments are those of `RegionPairs.of`."""
        pairs = RegionPairs.of(regions, across, down, parts)
        owner = np.arange(len(pairs.pixels))
        coefficients = np.array([self.affinity, self.same_part, self.log_pixels])
        while True:
            odds = np.where(pairs.borders > 0, self.intercept + pairs.measures() @ coefficients, 0)
            target, source = np.unravel_index(odds.argmax(), odds.shape)
            if odds[target, source] <= 0:
                return owner[regions]
            owner[owner == source] = target
            pairs.join(int(target), int(source))


@dataclass(frozen=True, eq=False)
class RegionPairs:
    """What is measured of regions and of the borders between them; joining changes it in place.

    Args:
        sums: (R, R) of log odds along borders.
        borders: (R, R) lengths of borders (pixels); 0: no border.
        pixels: (R, P) pixels of a region in each part of another segmentation.
    """

    sums: Float64
    borders: Float64
    pixels: Float64

    @classmethod
    def of(cls, regions: Int32, across: Float64, down: Float64, parts: Int32) -> RegionPairs:
        """Of an image.

        Args:
            regions: (H, W), 0 = none.
            across: (H, W - 1) log odds that a pixel and its right neighbour are of one object.
            down: (H - 1, W) the same for the one below.
            parts: (H, W) of the other segmentation.
        """
        sums, borders = along_borders(regions, across, down)
        pixels = np.zeros((len(sums), int(parts.max(initial=0)) + 1))
        np.add.at(pixels, (regions, parts), 1)
        return cls(sums, borders, pixels)

    def measures(self) -> Float64:
        """Of each pair (R, R, 3): mean log odds, same part or not, log of the smaller's pixels."""
        means = self.sums / np.maximum(self.borders, 1)
        part, sizes = self.pixels.argmax(axis=1), self.pixels.sum(axis=1)
        smaller = np.maximum(np.minimum(sizes[:, None], sizes), 1)
        return np.stack([means, part[:, None] == part, np.log(smaller)], axis=-1)

    def join(self, target: int, source: int) -> None:
        """Makes one region of two; the second has no border and no pixel afterwards."""
        for table in (self.sums, self.borders):
            table[target] += table[source]
            table[:, target] += table[:, source]
            table[source] = table[:, source] = table[target, target] = 0
        self.pixels[target] += self.pixels[source]
        self.pixels[source] = 0
