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


class ResidualReassignment:
    """Gives each pixel to the object on whose superquadric it lies.

    A view in which two objects look like one makes a part that belongs to neither. If other views
    show both, their superquadrics explain what that part shows; then it is given up, and its pixels
    go to them. So do pixels at borders that a mask gave to the wrong side. Things that no
    superquadric describes keep theirs: there, to be off the own surface says nothing.

    Args:
        fits: of superquadrics to segments.
        inlier_distance: seen points up to this far from a surface are explained (m).
        min_explained_ratio: share of an object's pixels from which on others explain it.
        min_inlier_ratio: share of an object's pixels that its own superquadric must explain before
            pixels off it go to others.
        min_pixels: objects of fewer pixels stay as they are.

    Raises:
        ConfigError: a distance that isn't positive, a share outside 0..1, or fewer than 4 pixels.
    """

    def __init__(
        self,
        fits: SegmentFits,
        inlier_distance: float = 0.005,
        min_explained_ratio: float = 0.85,
        min_inlier_ratio: float = 0.0,
        min_pixels: int = 30,
    ) -> None:
        POSITIVE.require(inlier_distance=inlier_distance)
        PART.require(min_explained_ratio=min_explained_ratio)
        SHARE.require(min_inlier_ratio=min_inlier_ratio)
        at_least(4).require(min_pixels=min_pixels)
        self.fits = fits
        self.inlier_distance, self.min_explained_ratio, self.min_inlier_ratio, self.min_pixels = (
            inlier_distance,
            min_explained_ratio,
            min_inlier_ratio,
            min_pixels,
        )

    def reassign(self, objects: Int32, view: ViewGeometry) -> Int32:
        """Objects (H, W), 0 = none, of one image or of several, stacked."""
        while True:
            labels, distances = self._distances(objects, view)
            redundant_label = self._redundant_label(objects, labels, distances)
            if redundant_label is None:
                return self._reassign_pixels(objects, labels, distances)
            competitors = labels != redundant_label
            object_mask = objects == redundant_label
            nearest_labels = labels[competitors][
                distances[competitors][:, object_mask].argmin(axis=0)
            ]
            objects = objects.copy()
            objects[object_mask] = nearest_labels

    def _distances(self, objects: Int32, view: ViewGeometry) -> tuple[Int32, Distances]:
        """Labels (N,) of large objects, and distances (N, H, W) of pixels to their surfaces (m)."""
        all_labels, counts = np.unique(objects[objects > 0], return_counts=True)
        labels = all_labels[counts >= self.min_pixels]
        fits = self.fits.of(labels.tolist(), objects, view)
        distances = np.full((len(labels), *objects.shape), np.inf)
        foreground = objects > 0
        for row, (superquadric, _) in enumerate(fits):
            distances[row, foreground] = np.abs(
                signed_distance(superquadric, view.points[foreground])
            )
        return labels, distances

    def _redundant_label(self, objects: Int32, labels: Int32, distances: Distances) -> int | None:
        """The object that others explain best, if they do."""
        shares = {}
        for row, label in enumerate(labels.tolist()):
            competing_distances = np.delete(distances[:, objects == label], row, axis=0)
            if len(competing_distances):
                shares[label] = float(
                    (competing_distances.min(axis=0) < self.inlier_distance).mean()
                )
        best = max(shares, key=shares.__getitem__, default=None)
        return best if best is not None and shares[best] >= self.min_explained_ratio else None

    def _reassign_pixels(self, objects: Int32, labels: Int32, distances: Distances) -> Int32:
        """Pixels off their own object's surface and on another's, at that one."""
        if not len(labels):
            return objects
        nearest_labels = labels[distances.argmin(axis=0)]
        rows = np.searchsorted(labels, objects) % len(labels)
        object_distances = np.take_along_axis(distances, rows[None], 0)[0]
        reassign_mask = (
            (labels[rows] == objects)
            & (object_distances > self.inlier_distance)
            & (distances.min(axis=0) < self.inlier_distance)
        )
        reassign_mask &= (
            self._inlier_ratios(objects, labels, distances)[rows] >= self.min_inlier_ratio
        )
        return np.where(reassign_mask, nearest_labels, objects).astype(np.int32)

    def _inlier_ratios(self, objects: Int32, labels: Int32, distances: Distances) -> Distances:
        """Shares (N,) of each object's pixels that lie on its own surface."""
        pairs = zip(labels.tolist(), distances, strict=True)
        return np.array(
            [(gaps[objects == label] < self.inlier_distance).mean() for label, gaps in pairs]
        )
