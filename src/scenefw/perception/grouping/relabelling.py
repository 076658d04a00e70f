"""Which segments of an image are one object, and which voxels of rough volumes are theirs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.spatial import cKDTree

from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.observation.mixed_pixels import without_ramps
from scenefw.perception.observation.points import MINORITY, SAMPLE
from scenefw.perception.steps import Objects

if TYPE_CHECKING:
    from scenefw.core.types import Float32, Float64, GridSpec, Int32
    from scenefw.perception.observation.observation import Observation, ViewGeometry
    from scenefw.perception.steps import Grouping


class Splitting(Protocol):
    """Cuts segments that hold several objects."""

    def split(self, parts: Int32, view: ViewGeometry) -> Int32:
        """Segments (H, W), 0 = none."""


class Merging(Protocol):
    """Joins segments of one object."""

    def merge(self, parts: Int32, view: ViewGeometry, depth: Float32) -> Int32:
        """Objects (H, W), 0 = none."""


class Joining(Protocol):
    """Joins segments of one object that no convex shape explains."""

    def join(self, segments: Int32, view: ViewGeometry) -> Int32:
        """Segments (H, W), 0 = none."""


class ObjectGrouping:
    """Objects from segments: split and merged.

    The image is sharp where objects meet, so segments decide borders. In the end each voxel of a
    rough volume goes to the object of the visible point of that volume that is nearest. Volumes
    that no pixel shows stay, as a network may know of them. If someone has marked the objects,
    these are the segments, and stay.

    Args:
        rough: makes volumes of segments.
        split: cuts segments of several objects; None: none are cut.
        merge: joins segments of one object; None: none are joined.
        vessels: joins inside and outside of vessels; None: they stay apart.
    """

    def __init__(
        self,
        rough: Grouping,
        split: Splitting | None = None,
        merge: Merging | None = None,
        vessels: Joining | None = None,
    ) -> None:
        self.rough, self.split, self.merge, self.vessels = rough, split, merge, vessels

    @property
    def grid(self) -> GridSpec | None:
        """That of the rough volumes; None: any."""
        return self.rough.grid

    def group(self, segments: Int32 | None, view: Observation) -> Objects:
        """The objects of a view, with rough volumes.

        Args:
            segments: (H, W), 0 = none.
            view: of their image.
        """
        has_masks, segments = view.masks is not None, Objects(segments).pixels
        segments = segments if has_masks else without_ramps(segments, view.mixed)
        rough = self.rough.group(segments, view)
        if rough.instances is None:
            raise TypeError("objects without volumes can't be relabelled")
        points, grid = view.points, view.grid
        volumes = visible_instances(rough.instances, points, grid, segments > 0)
        objects = segments
        if not has_masks and self.split is not None:
            objects = self.split.split(objects, view)
        if not has_masks and self.merge is not None:
            objects = self.merge.merge(objects, view, view.depth)
        if not has_masks and self.vessels is not None:
            objects = self.vessels.join(objects, view)
        labels = reassigned(rough.instances, volumes, objects, points, grid)
        return Objects(objects, rough.tsdf, labels, rough.volumes)


def reassigned(
    instances: Int32, pixel_instances: Int32, objects: Int32, points: Float64, grid: GridSpec
) -> Int32:
    """Instances (X, Y, Z) that are the objects which their pixels show.

    An instance that shows several objects is divided: each of its voxels goes to the one of the
    nearest seen point. Objects of less than a tenth of its pixels are its neighbours'
    and get none of it.

    Args:
        instances: (X, Y, Z) labels, 0 = no object.
        pixel_instances: (H, W) which of them a pixel shows, 0 = none.
        objects: (H, W) which object a pixel shows instead, 0 = none.
        points: (H, W, 3) of the pixels, world coordinates (m).
        grid: of the volume.
    """
    labels, next_label = np.zeros_like(instances), int(objects.max(initial=0)) + 1
    centres = grid.centres()
    for label in np.unique(instances[instances > 0]):
        instance_mask = instances == label
        votes = np.bincount(objects[(pixel_instances == label) & (objects > 0)], minlength=1)
        owners = np.flatnonzero(votes > MINORITY * votes.sum())
        if not len(owners):
            labels[instance_mask] = next_label
            next_label += 1
            continue
        pixels = (pixel_instances == label) & np.isin(objects, owners)
        step = -(-int(pixels.sum()) // SAMPLE)
        pixel_labels, pixel_points = objects[pixels][::step], points[pixels][::step]
        nearest = cKDTree(pixel_points).query(centres[instance_mask])[1]
        labels[instance_mask] = pixel_labels[nearest]
    return labels
