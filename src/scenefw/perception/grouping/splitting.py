"""Parts of an image cut in two where two superquadrics explain what one does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label as components
from scipy.ndimage import median_filter

from scenefw.core.settings import COUNT, POSITIVE
from scenefw.fitting.placed import OUTLIERS, signed_distance
from scenefw.perception.evidence.silhouettes import box_about
from scenefw.perception.observation.components import NOISE
from scenefw.perception.observation.pixels import BLUR, WIDTH
from scenefw.perception.observation.points import MIN_POINTS, STRAYS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Int32
    from scenefw.perception.grouping.segment_fits import SegmentFits
    from scenefw.perception.observation.observation import ViewGeometry


@dataclass(frozen=True, eq=False)
class _Trial:
    """Two pieces of a part, and the squared deviation of all its pixels."""

    parts: Int32
    deviations: NDArray[np.float64]


class FitSplitting:
    """Cuts parts of which one superquadric leaves a connected region unexplained.

    Where two objects touch without a jump or a crease, they look like one part. A robust fit then
    follows the larger, and the rest lies off its surface. Each is fitted to its own pixels, and
    pixels go to the nearer surface, in turns.

    Args:
        fits: of superquadrics to segments.
        min_gain: squared deviations, over all pixels of the part (of an image 640 wide), that
            two superquadrics must save.
        max_deviation: mean squared deviation of what is a superquadric: the part has more, and its
            pieces don't.
        min_pixels: pixels of a piece (of an image 640 wide).
        rounds: how often pixels are dealt out anew.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        fits: SegmentFits,
        min_gain: float = 3000.0,
        max_deviation: float = 0.3,
        min_pixels: int = 100,
        rounds: int = 5,
    ) -> None:
        POSITIVE.require(
            min_gain=min_gain,
            max_deviation=max_deviation,
            min_pixels=min_pixels,
        )
        COUNT.require(rounds=rounds)
        self.fits, self.min_gain = fits, min_gain
        self.max_deviation, self.min_pixels, self.rounds = max_deviation, min_pixels, rounds

    def split(self, parts: Int32, view: ViewGeometry) -> Int32:
        """Parts (H, W), 0 = none, some of them cut; new ones have new numbers."""
        sizes = np.bincount(parts.ravel())
        large = np.flatnonzero(sizes >= 4 * self._min_pixels(parts))
        queue = large[large > 0].tolist()
        while queue:
            superquadrics = self._fit(queue, parts, view)
            next_queue = []
            for part, superquadric in zip(queue, superquadrics, strict=True):
                new_parts = self._split_part(part, parts, superquadric, view)
                if new_parts is not None:
                    next_queue += [part, int(new_parts.max())]
                    parts = new_parts
            queue = next_queue
        return parts

    def _split_part(
        self, part: int, parts: Int32, superquadric: FittedSuperquadric, view: ViewGeometry
    ) -> Int32 | None:
        """The parts with this one cut in two; None if that explains no more."""
        part_mask = parts == part
        deviations = self._deviations(superquadric, view, part_mask)
        if deviations.mean() < self.max_deviation:
            return None
        trial = self._initial_trial(part, parts, superquadric, view)
        for _ in range(self.rounds):
            if trial is None:
                return None
            old_parts, trial = (
                trial.parts,
                self._reassign_pixels(part, trial.parts, part_mask, view),
            )
            if trial is not None and np.array_equal(trial.parts, old_parts):
                break  # further rounds give the same
        if trial is None or trial.deviations.mean() > self.max_deviation:
            return None
        improvement = (deviations - trial.deviations).sum() * (WIDTH / parts.shape[1]) ** 2
        return trial.parts if improvement > self.min_gain else None

    def _initial_trial(
        self, part: int, parts: Int32, superquadric: FittedSuperquadric, view: ViewGeometry
    ) -> _Trial | None:
        """The largest region off the surface as a part of its own."""
        part_mask = parts == part
        outliers = np.zeros(part_mask.shape, dtype=bool)
        distances = np.abs(signed_distance(superquadric, view.points[part_mask]))
        outliers[part_mask] = distances > OUTLIERS * NOISE
        regions, _ = components(outliers)
        sizes = np.bincount(regions.ravel())
        sizes[0] = 0
        if sizes.max() < max(self._min_pixels(parts), STRAYS * part_mask.sum()):
            return None
        new_parts = np.where(regions == sizes.argmax(), parts.max() + 1, parts).astype(np.int32)
        return _Trial(new_parts, np.empty(0)) if self._is_large(part, new_parts) else None

    def _reassign_pixels(
        self, part: int, parts: Int32, part_mask: NDArray[np.bool_], view: ViewGeometry
    ) -> _Trial | None:
        """Both pieces fitted, and the pixels of both given to the nearer surface."""
        new_label = int(parts.max())
        deviations = [
            self._deviations(f, view, part_mask) for f in self._fit([part, new_label], parts, view)
        ]
        side = np.zeros(part_mask.shape, dtype=np.int32)
        side[part_mask] = np.where(deviations[0] <= deviations[1], 1, 2)
        box = box_about(part_mask, BLUR)
        smooth_side = np.zeros_like(side)
        smooth_side[box] = median_filter(side[box], 2 * BLUR + 1)
        side = np.where(part_mask & (smooth_side > 0), smooth_side, side)
        new_parts = np.where(part_mask, np.where(side == 2, new_label, part), parts).astype(
            np.int32
        )
        if not self._is_large(part, new_parts):
            return None
        return _Trial(
            new_parts, np.where(new_parts[part_mask] == new_label, deviations[1], deviations[0])
        )

    def _is_large(self, part: int, parts: Int32) -> bool:
        """Whether both pieces are large enough."""
        sizes = [(parts == label).sum() for label in (part, parts.max())]
        return bool(min(sizes) >= self._min_pixels(parts))

    def _min_pixels(self, parts: Int32) -> float:
        """Of a piece of this image: enough for a fit, however small the image is."""
        return max(self.min_pixels * (parts.shape[1] / WIDTH) ** 2, MIN_POINTS)

    def _fit(
        self, labels: Sequence[int], parts: Int32, view: ViewGeometry
    ) -> list[FittedSuperquadric]:
        return [shape for shape, _ in self.fits.of(labels, parts, view)]

    def _deviations(
        self, fitted: FittedSuperquadric, view: ViewGeometry, mask: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        return self.fits.deviations(fitted, view.points[mask])
