"""Pixels go to the object on whose superquadric they lie."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.settings import PART, POSITIVE, SHARE, at_least
from scenefw.fitting.placed import signed_distance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Int32
    from scenefw.perception.grouping.segment_fits import SegmentFits
    from scenefw.perception.observation.observation import ViewGeometry

    Distances = NDArray[np.float64]


class DealtByFit:
    """Gives each pixel to the object on whose superquadric it lies.

    A view in which two objects look like one makes a part that belongs to neither. If other views
    show both, their superquadrics explain what that part shows; then it is given up, and its pixels
    go to them. So do pixels at borders that a mask gave to the wrong side. Things that no
    superquadric describes keep theirs: there, to be off the own surface says nothing.

    Args:
        fits: of superquadrics to segments.
        near: seen points up to this far from a surface are explained (m).
        explained: share of an object's pixels from which on others explain it.
        trusted: share of an object's pixels that its own superquadric must explain before pixels
            off it go to others.
        least: objects of fewer pixels stay as they are.

    Raises:
        ConfigError: a distance that isn't positive, a share outside 0..1, or fewer than 4 pixels.
    """

    def __init__(
        self,
        fits: SegmentFits,
        near: float = 0.005,
        explained: float = 0.85,
        trusted: float = 0.0,
        least: int = 30,
    ) -> None:
        POSITIVE.require(near=near)
        PART.require(explained=explained)
        SHARE.require(trusted=trusted)
        at_least(4).require(least=least)
        self.fits = fits
        self.near, self.explained, self.trusted, self.least = near, explained, trusted, least

    def reassign(self, objects: Int32, view: ViewGeometry) -> Int32:
        """Objects (H, W), 0 = none, of one image or of several, stacked."""
        while True:
            labels, away = self._distances(objects, view)
            repeated = self._repeated(objects, labels, away)
            if repeated is None:
                return self._dealt(objects, labels, away)
            others = labels != repeated
            own = objects == repeated
            nearest = labels[others][away[others][:, own].argmin(axis=0)]
            objects = objects.copy()
            objects[own] = nearest

    def _distances(self, objects: Int32, view: ViewGeometry) -> tuple[Int32, Distances]:
        """Labels (N,) of large objects, and distances (N, H, W) of pixels to their surfaces (m)."""
        found, pixels = np.unique(objects[objects > 0], return_counts=True)
        labels = found[pixels >= self.least]
        fits = self.fits.of(labels.tolist(), objects, view)
        away = np.full((len(labels), *objects.shape), np.inf)
        shown = objects > 0
        for row, (one, _) in enumerate(fits):
            away[row, shown] = np.abs(signed_distance(one, view.points[shown]))
        return labels, away

    def _repeated(self, objects: Int32, labels: Int32, away: Distances) -> int | None:
        """The object that others explain best, if they do."""
        shares = {}
        for row, label in enumerate(labels.tolist()):
            others = np.delete(away, row, axis=0)[:, objects == label]
            if len(others):
                shares[label] = float((others.min(axis=0) < self.near).mean())
        best = max(shares, key=shares.__getitem__, default=None)
        return best if best is not None and shares[best] >= self.explained else None

    def _dealt(self, objects: Int32, labels: Int32, away: Distances) -> Int32:
        """Pixels off their own object's surface and on another's, at that one."""
        if not len(labels):
            return objects
        nearest = labels[away.argmin(axis=0)]
        rows = np.searchsorted(labels, objects) % len(labels)
        own = np.take_along_axis(away, rows[None], 0)[0]
        moved = (labels[rows] == objects) & (own > self.near) & (away.min(axis=0) < self.near)
        moved &= self._on_own(objects, labels, away)[rows] >= self.trusted
        return np.where(moved, nearest, objects).astype(np.int32)

    def _on_own(self, objects: Int32, labels: Int32, away: Distances) -> Distances:
        """Shares (N,) of each object's pixels that lie on its own surface."""
        pairs = zip(labels.tolist(), away, strict=True)
        return np.array([(far[objects == label] < self.near).mean() for label, far in pairs])
