"""Instances of a network's scenes, regrouped by what the depth image itself separates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from scipy.spatial import cKDTree

from scenefw.core.errors import ConfigError
from scenefw.core.protocols import Reconstructor
from scenefw.perception.evidence.gathering import View, seen_free
from scenefw.perception.evidence.visible_instances import seen_instances
from scenefw.perception.observation.mixed_pixels import mixed_pixels, without_ramps
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.protocols import PartFinder
    from scenefw.core.types import Float32, Float64, Frame, GridSpec, Int32
    from scenefw.postprocessing.confidence import Calibration

_MOST_POINTS = 3000  # of an instance: enough to say which is nearest to a voxel
_FRINGE = 0.1  # of an instance's pixels


class Completing(Reconstructor, Protocol):
    """A reconstructor that knows its origin."""

    @property
    def metadata(self) -> dict[str, Any]:
        """What its checkpoint records."""


def each_once(
    scenes: Sequence[Completion], change: Callable[[Completion], Completion]
) -> list[Completion]:
    """Changed scenes; one that stands several times, as of a method without samples, once."""
    changed = {id(scene): change(scene) for scene in {id(one): one for one in scenes}.values()}
    return [changed[id(scene)] for scene in scenes]


class Grouping(Protocol):
    """Says which parts of an image are one object."""

    def objects(self, parts: Int32, view: View, depth: Float32) -> Int32:
        """Objects (H, W), 0 = none, of parts (H, W) and a view whose masks are a network's."""


class _Known:
    """Parts that are objects already, as someone has marked them."""

    def objects(self, parts: Int32, view: View, depth: Float32) -> Int32:
        """The parts themselves."""
        return parts


@dataclass(frozen=True)
class _Image:
    """An image, its parts (H, W), and what its points say, once for all scenes."""

    frame: Frame
    parts: Int32
    points: Float64
    eye: Float64
    mixed: NDArray[np.bool_]
    free: NDArray[np.bool_]

    @classmethod
    def of(cls, frame: Frame, parts: Int32, free: NDArray[np.bool_]) -> _Image:
        points, eye = world_points(frame), frame.camera.T_world_camera[:3, 3]
        return cls(frame, parts, points, eye, mixed_pixels(points, eye), free)


class PartGuided:
    """Another reconstructor's scenes, with instances that agree with the parts of the image.

    The image is sharp where objects meet. So its parts decide borders, and parts that belong to
    one object are joined. Then each voxel of an instance goes to the object of the seen point of
    that instance that is nearest. Instances that no pixel shows stay, as a network may know of
    them. `inner` is told the parts; a `HullFilling` without own ones fills these, and makes no
    others. If a view has masks of its objects, these stand for the parts.

    Args:
        inner: makes the scenes; sees the parts as `PartialTSDF.parts`.
        parts: of the image.
        grouping: says which parts are one object.
        reach: how far outside an instance a seen point may lie and still be its (voxels).

    Raises:
        ConfigError: a reach that isn't positive.
    """

    calibration: Calibration | None = None

    def __init__(
        self, inner: Completing, parts: PartFinder, grouping: Grouping, reach: float = 2.0
    ) -> None:
        if not reach > 0:
            raise ConfigError(f"reach is {reach}; expected a positive number of voxels")
        self.inner, self.parts, self.grouping, self.reach = inner, parts, grouping, reach
        self.grid, self.metadata = inner.grid, inner.metadata

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """Complete scenes with masks of what is seen of each instance.

        Raises:
            InputError: the partial TSDF came without its depth images.
        """
        images = seen_frames(partial, "cutting into parts")
        free = seen_free(partial, grid)
        known = None if partial.masks is None else partial.masks.cpu().numpy()
        found = partial.parts if known is None else partial.masks
        parts = map(self.parts.segment, images) if found is None else found.cpu().numpy()
        seen = [_Image.of(*each) for each in zip(images, parts, free, strict=True)]
        if known is None:
            seen = [replace(one, parts=without_ramps(one.parts, one.mixed)) for one in seen]
        told = torch.from_numpy(np.stack([one.parts for one in seen]))
        partial = replace(partial, parts=told.to(partial.distance.device))
        scenes = self.inner.complete(partial, grid, samples, generator)
        grouping = self.grouping if known is None else _Known()
        return each_once(scenes, lambda sample: self._regrouped(sample, seen, grid, grouping))

    def _regrouped(
        self,
        sample: Completion,
        seen: Sequence[_Image],
        grid: GridSpec,
        grouping: Grouping,
    ) -> Completion:
        tsdf, labels = sample.tsdf.cpu().numpy(), sample.instances.cpu().numpy()
        volumes, masks = [], []
        for i, one in enumerate(seen):
            shown = seen_instances(labels[i], one.points, grid, one.parts > 0, self.reach)
            view = View(one.points, shown, tsdf[i], labels[i], one.free, grid, one.eye, one.mixed)
            objects = grouping.objects(one.parts, view, one.frame.depth)
            volumes.append(reassigned(labels[i], shown, objects, one.points, grid))
            masks.append(objects)
        device = sample.instances.device
        return replace(
            sample,
            instances=torch.from_numpy(np.stack(volumes)).to(device),
            masks=torch.from_numpy(np.stack(masks)).to(device),
        )


def reassigned(
    instances: Int32, shown: Int32, objects: Int32, points: Float64, grid: GridSpec
) -> Int32:
    """Instances (X, Y, Z) that are the objects which their pixels show.

    An instance that shows several objects is divided: each of its voxels goes to the one of the
    nearest seen point. Objects of less than `_FRINGE` of its pixels are its neighbours' and get
    none of it.

    Args:
        instances: (X, Y, Z) labels, 0 = no object.
        shown: (H, W) which of them a pixel shows, 0 = none.
        objects: (H, W) which object a pixel shows instead, 0 = none.
        points: (H, W, 3) of the pixels, world coordinates (m).
        grid: of the volume.
    """
    found, unused = np.zeros_like(instances), int(objects.max(initial=0)) + 1
    centres = grid.centres()
    for label in np.unique(instances[instances > 0]):
        own = instances == label
        votes = np.bincount(objects[(shown == label) & (objects > 0)], minlength=1)
        kept = np.flatnonzero(votes > _FRINGE * votes.sum())
        if not len(kept):
            found[own] = unused
            unused += 1
            continue
        pixels = (shown == label) & np.isin(objects, kept)
        step = -(-int(pixels.sum()) // _MOST_POINTS)
        here, there = objects[pixels][::step], points[pixels][::step]
        nearest = cKDTree(there).query(centres[own])[1]
        found[own] = here[nearest]
    return found
