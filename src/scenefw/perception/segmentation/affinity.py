"""Parts of a depth image by a trained network of affinities."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label
from scipy.special import logit
from skimage.morphology import h_minima
from skimage.segmentation import watershed

from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE, below
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.observation.components import EDGE, TOUCH, neighbours
from scenefw.perception.observation.floor_noise import ROUNDING
from scenefw.perception.observation.pixel_probabilities import log_odds, pixel_probabilities
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import MAJORITY
from scenefw.perception.segmentation.crease_segmentation import high_parts
from scenefw.perception.segmentation.region_merging import RegionMerging
from scenefw.perception.segmentation.regions import grown, large_parts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.part_protocols import PartAffinityModel
    from scenefw.core.training_protocols import Trained
    from scenefw.core.types import Float32, Float64, Int32
    from scenefw.perception.observation.observation import Observation


@dataclass(frozen=True, eq=False)
class AffinitySegmentation:
    """Cuts a depth image above the floor where a network finds different objects.

    Regions end where the network is least sure that neighbouring pixels show the same object, by a
    watershed; which of them are one object, `merging` says.
    Images are thinned to about the focal length that the network learnt from. Where the floor waves
    and the network says which pixels show objects, it is believed: the bottom of a bowl is as low
    as waves, and ramps of depth beside objects are high. Parts that it takes for no object are
    dropped.

    Args:
        checkpoint: of a network of affinities.
        min_basin_depth: log odds: between two regions links are weaker by more than this than the
            strongest ones within either.
        min_pixel_probability: where depth has noise, pixels that don't show an object more probably
            than this belong to none; 0: what the network says of them counts nowhere. Where errors
            of neighbouring pixels are independent, points within three standard deviations of them
            belong to the floor, and the network's odds count times those by which the floor,
            normally distributed, doesn't reach the pixel's height.
        floor_margin: points up to this height above the floor (m) belong to it where depth is
            exact, or nothing else says which pixels show objects. Parts that rise no higher are
            noise of the floor, and so are those within the reach of its errors.
        min_pixels: parts of fewer pixels (of an image 640 wide) are dropped.
        merging: which regions are joined; None: none.

    Raises:
        ConfigError: a probability outside 0..1, a negative height, or fewer than 1 pixel.
    """

    checkpoint: Trained[PartAffinityModel]
    min_basin_depth: float = 3.0
    min_pixel_probability: float = 0.9
    floor_margin: float = 0.005
    min_pixels: float = 60.0
    merging: RegionMerging | None = field(default_factory=RegionMerging)

    def __post_init__(self) -> None:
        POSITIVE.require(min_basin_depth=self.min_basin_depth)
        below(1).require(min_pixel_probability=self.min_pixel_probability)
        NOT_NEGATIVE.require(floor_margin=self.floor_margin)
        COUNT.require(min_pixels=self.min_pixels)

    def segment(self, view: Observation) -> Int32:
        """Parts (H, W), 0 = none, of a depth image."""
        frame, heights = view.frame, view.heights
        noise = view.noise
        probabilities = pixel_probabilities(self.checkpoint.model, frame)
        step = probabilities.step
        across, down = log_odds(probabilities.across), log_odds(probabilities.down)
        depth = np.ascontiguousarray(np.nan_to_num(frame.depth[::step, ::step]), np.float32)
        rows, columns = (np.arange(size) // step for size in frame.depth.shape)
        thinned_pixels = np.ix_(rows, columns)
        objects = probabilities.objects if self.min_pixel_probability else None
        if objects is None or noise.sigma <= ROUNDING:
            above = heights > self.floor_margin  # NaN where no depth: not above
        else:
            odds, above = logit(objects)[thinned_pixels], np.isfinite(heights)
            if not noise.is_correlated:
                sigma = noise.at(view.depth)
                above &= heights > OUTLIERS * sigma
                odds = odds + (heights / np.maximum(sigma, ROUNDING)) ** 2 / 2
            above &= odds > logit(self.min_pixel_probability)
        regions = self._regions(across, down, above[::step, ::step])
        merged_regions = regions.astype(np.int64)
        if self.merging is not None:
            creases = self.merging.creases.segment(view)[::step, ::step]
            merged_regions = self.merging.merged(regions, across, down, creases)
        min_pixels = self.min_pixels * (frame.depth.shape[1] / WIDTH) ** 2
        parts = large_parts(merged_regions, max(1, round(min_pixels / step**2)))
        if objects is not None:
            is_unlikely = (parts > 0) & (_means(objects, parts) < MAJORITY)
            parts = large_parts(np.where(is_unlikely, 0, parts).astype(np.int64), 1)
            above &= ~is_unlikely[thinned_pixels]
        same_depth = np.abs(frame.depth - depth[thinned_pixels]) < TOUCH
        parts = np.where(above & same_depth, parts[thinned_pixels], 0).astype(np.int32)
        parts = grown(parts, above, frame.depth, EDGE)
        return high_parts(parts, heights, np.maximum(self.floor_margin, noise.reach(view.depth)))

    def _regions(
        self, across: Float64, down: Float64, above: NDArray[np.bool_]
    ) -> NDArray[np.int32]:
        """Regions (H, W), 0 = none, of the thinned image, before neighbours are joined.

        They are basins of the weakest link of each pixel, by a watershed; a basin no deeper than
        `min_basin_depth` is part of a deeper one.
        """
        weakest = np.full(above.shape, log_odds(1.0))
        for links, slices in zip((across, down), neighbours(), strict=True):
            for pixels in slices:
                weakest[pixels] = np.minimum(weakest[pixels], links)
        relief = np.where(above, -weakest, -log_odds(0.0))
        basins = label(h_minima(relief, self.min_basin_depth) & above)[0]
        regions = watershed(relief, basins, mask=above)
        # twice: a pixel in a ridge's corner follows its neighbour
        return _within_links(_within_links(regions, across, down), across, down)


def _within_links(regions: NDArray[np.int32], across: Float64, down: Float64) -> NDArray[np.int32]:
    """Regions (H, W); pixels without a probable link to their own change to the likeliest other.

    To which side the pixels of a ridge go, a watershed leaves to chance.
    """
    highest, others = np.zeros(regions.shape), regions.copy()
    is_linked = np.zeros(regions.shape, bool)
    for links, (first, second) in zip((across, down), neighbours(), strict=True):
        is_same = regions[first] == regions[second]
        for pixels, neighbour in ((first, second), (second, first)):
            is_linked[pixels] |= is_same & (links > 0)
            is_better = ~is_same & (regions[neighbour] > 0) & (links > highest[pixels])
            highest[pixels] = np.where(is_better, links, highest[pixels])
            others[pixels] = np.where(is_better, regions[neighbour], others[pixels])
    return np.where(is_linked, regions, others)


def _means(values: Float32, parts: Int32) -> Float64:
    """Of each pixel (H, W), the mean of `values` (H, W) over its part."""
    sums = np.bincount(parts.ravel(), values.ravel())
    return np.asarray((sums / np.maximum(np.bincount(parts.ravel()), 1))[parts])
