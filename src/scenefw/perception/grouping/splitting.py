"""Parts of an image cut in two where two superquadrics explain what one does not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label as components
from scipy.ndimage import median_filter

from scenefw.core.settings import COUNT, POSITIVE
from scenefw.fitting.placed import signed_distance
from scenefw.perception.evidence.silhouettes import box_about
from scenefw.perception.observation.pixels import WIDTH

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Int32
    from scenefw.perception.grouping.segment_fits import SegmentFits
    from scenefw.perception.observation.observation import ViewGeometry

_FAR = 2.0  # deviations of pixels that the second superquadric starts from
_POOR = 0.3  # squared deviation of a part that one superquadric doesn't explain
_BLUR = 7  # pixels over which sides are evened out
_DEEPEST = 2  # cuts of a cut


@dataclass(frozen=True, eq=False)
class _Trial:
    """Two pieces of a part, and the squared deviation of all its pixels."""

    parts: Int32
    deviations: NDArray[np.float64]


class SplitByEvidence:
    """Cuts parts of which one superquadric leaves a connected region unexplained.

    Where two objects touch without a jump or a crease, they look like one part. A robust fit then
    follows the larger, and the rest lies off its surface. Each is fitted to its own pixels, and
    pixels go to the nearer surface, in turns.

    Args:
        fits: of superquadrics to segments.
        gain: squared deviations, over all pixels of the part (of an image 640 wide), that
            two superquadrics must save.
        share: of the part's pixels that the smaller piece must have, at least.
        left: mean squared deviation that may be left, else the pieces are no superquadrics either.
        smallest: pixels of a piece (of an image 640 wide).
        rounds: how often pixels are dealt out anew.

    Raises:
        ConfigError: a number that isn't positive.
    """

    def __init__(
        self,
        fits: SegmentFits,
        gain: float = 3000.0,
        share: float = 0.02,
        left: float = 0.3,
        smallest: int = 100,
        rounds: int = 5,
    ) -> None:
        POSITIVE.require(gain=gain, share=share, left=left, smallest=smallest)
        COUNT.require(rounds=rounds)
        self.fits, self.gain, self.share = fits, gain, share
        self.left, self.smallest, self.rounds = left, smallest, rounds

    def split(self, parts: Int32, view: ViewGeometry) -> Int32:
        """Parts (H, W), 0 = none, some of them cut; new ones have new numbers."""
        sizes = np.bincount(parts.ravel())
        large = np.flatnonzero(sizes >= 4 * self._smallest(parts))
        waiting = [(int(part), 0) for part in large[large > 0]]
        while waiting:
            fitted = self._fitted([part for part, _ in waiting], parts, view)
            further = []
            for (part, depth), one in zip(waiting, fitted, strict=True):
                cut = self._cut(part, parts, one, view)
                if cut is not None:
                    if depth + 1 < _DEEPEST:
                        further += [(part, depth + 1), (int(cut.max()), depth + 1)]
                    parts = cut
            waiting = further
        return parts

    def _cut(
        self, part: int, parts: Int32, one: FittedSuperquadric, view: ViewGeometry
    ) -> Int32 | None:
        """The parts with this one cut in two; None if that explains no more."""
        own = parts == part
        before = self._deviations(one, view, own)
        if before.mean() < _POOR:
            return None
        trial = self._started(part, parts, one, view)
        for _ in range(self.rounds):
            if trial is None:
                return None
            earlier, trial = trial.parts, self._dealt(part, trial.parts, own, view)
            if trial is not None and np.array_equal(trial.parts, earlier):
                break  # further rounds give the same
        if trial is None or trial.deviations.mean() > self.left:
            return None
        saved = (before - trial.deviations).sum() * (WIDTH / parts.shape[1]) ** 2
        return trial.parts if saved > self.gain else None

    def _started(
        self, part: int, parts: Int32, one: FittedSuperquadric, view: ViewGeometry
    ) -> _Trial | None:
        """The largest region off the surface as a part of its own."""
        own = parts == part
        far = np.zeros(own.shape, dtype=bool)
        distances = np.abs(signed_distance(one, view.points[own]))
        far[own] = distances > _FAR * self.fits.evidence.seen_sigma
        regions, _ = components(far)
        sizes = np.bincount(regions.ravel())
        sizes[0] = 0
        if sizes.max() < max(self._smallest(parts), self.share * own.sum()):
            return None
        cut = np.where(regions == sizes.argmax(), parts.max() + 1, parts).astype(np.int32)
        return _Trial(cut, np.empty(0)) if self._large(part, cut) else None

    def _dealt(
        self, part: int, parts: Int32, own: NDArray[np.bool_], view: ViewGeometry
    ) -> _Trial | None:
        """Both pieces fitted, and the pixels of both given to the nearer surface."""
        new = int(parts.max())
        both = [self._deviations(f, view, own) for f in self._fitted([part, new], parts, view)]
        side = np.zeros(own.shape, dtype=np.int32)
        side[own] = np.where(both[0] <= both[1], 1, 2)
        about = box_about(own, _BLUR // 2)
        even = np.zeros_like(side)
        even[about] = median_filter(side[about], _BLUR)
        side = np.where(own & (even > 0), even, side)
        dealt = np.where(own, np.where(side == 2, new, part), parts).astype(np.int32)
        if not self._large(part, dealt):
            return None
        return _Trial(dealt, np.where(dealt[own] == new, both[1], both[0]))

    def _large(self, part: int, parts: Int32) -> bool:
        """Whether both pieces are large enough."""
        sizes = [(parts == label).sum() for label in (part, parts.max())]
        return bool(min(sizes) >= self._smallest(parts))

    def _smallest(self, parts: Int32) -> float:
        return self.smallest * (parts.shape[1] / WIDTH) ** 2

    def _fitted(
        self, labels: Sequence[int], parts: Int32, view: ViewGeometry
    ) -> list[FittedSuperquadric]:
        return [shape for shape, _ in self.fits.of(labels, parts, view)]

    def _deviations(
        self, fitted: FittedSuperquadric, view: ViewGeometry, own: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        return self.fits.deviations(fitted, view.points[own])
