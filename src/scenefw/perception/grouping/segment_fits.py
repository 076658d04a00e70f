"""Superquadrics of segments, each set of pixels fitted once."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from scenefw.fitting.placed import robust_deviation
from scenefw.perception.steps import Objects

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.protocols import ShapeFit
    from scenefw.core.types import Float64, Int32
    from scenefw.perception.evidence.gathering import EvidenceGathering
    from scenefw.perception.observation.observation import ViewGeometry

    Fit = tuple[FittedSuperquadric, Evidence]


class SegmentFits:
    """Fits a superquadric to each segment by itself, and remembers it until the next view.

    Splitting, merging and reassignment ask for fits of the same pixels. A fit depends on the
    evidence about its segment alone, so each is computed once.

    Args:
        fit: of superquadrics.
        evidence: what a view says about an object.
    """

    def __init__(self, fit: ShapeFit, evidence: EvidenceGathering) -> None:
        self.fit, self.evidence = fit, evidence.of_segments
        self._fits: dict[bytes, FittedSuperquadric] = {}
        self._points: Float64 | None = None  # of the view whose fits these are

    def of(self, labels: Sequence[int], masks: Int32, view: ViewGeometry) -> list[Fit]:
        """The superquadric of each segment, and the evidence that it is fitted to.

        Args:
            labels: of the segments.
            masks: (H, W) labels, 0 = none.
            view: of their image.
        """
        return self.of_groups([[label] for label in labels], masks, view)

    def of_groups(
        self, groups: Sequence[Collection[int]], masks: Int32, view: ViewGeometry
    ) -> list[Fit]:
        """The same of segments that are taken for one object, for each group of labels."""
        evidence = self.evidence.of_each(groups, Objects(masks), view)
        fits = self._fits if self._points is view.points else {}
        keys = [_digest(item) for item in evidence]
        new_evidence = {k: item for k, item in zip(keys, evidence, strict=True) if k not in fits}
        new_fits = dict(zip(new_evidence, self.fit.fit(list(new_evidence.values())), strict=True))
        shapes = [new_fits[key] if key in new_fits else fits[key] for key in keys]
        self._points, self._fits = view.points, fits | new_fits
        return list(zip(shapes, evidence, strict=True))

    def deviations(self, shape: FittedSuperquadric, points: Float64) -> Float64:
        """Robust squared deviations (N,) of points (N, 3) from a superquadric."""
        return robust_deviation(shape, points, self.evidence.visible_sigma)


def _digest(evidence: Evidence) -> bytes:
    digest = hashlib.blake2b(digest_size=16)
    for array in (evidence.points, evidence.sigmas, evidence.outside, evidence.outside_sigmas):
        digest.update(array.tobytes())
    return digest.digest()
