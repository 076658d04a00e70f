"""Instances of a network's scenes, regrouped by what the depth image itself separates."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from scenefw.core.errors import ConfigError
from scenefw.perception.depth_parts import grown
from scenefw.perception.points import world_points
from scenefw.perception.seen_frames import seen_frames
from scenefw.perception.seen_instances import seen_instances

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.types import Float64, Frame, GridSpec, Int32
    from scenefw.perception.seen_parts import SeenParts

_MOST_POINTS = 3000  # of an instance: enough to say which is nearest to a voxel
_FRINGE = 0.1  # of an instance's pixels


class Completing(Protocol):
    """A reconstructor that says all it knows of a scene."""

    @property
    def grid(self) -> GridSpec | None:
        """The grid of its volumes; None if it takes any."""

    @property
    def metadata(self) -> dict[str, Any]:
        """What its checkpoint records."""

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> Sequence[Completion]:
        """Complete scenes of B partial views, once per code."""


class PartGuided:
    """Another reconstructor's scenes, with instances that agree with the parts of the image.

    The image is sharp where objects meet, a network knows what belongs together behind what hides
    it. So parts decide borders, and the network joins and divides them:

    - parts of one instance are one object if they don't touch in the image (what hides a third of
      an object leaves two parts of it), or if one is a fragment of the other;
    - a part of which several instances have a large share is divided among them.

    Then each voxel of an instance goes to the object of the seen point of that instance that is
    nearest. Instances that no pixel shows stay.

    Args:
        inner: makes the scenes.
        parts: of the image.
        share: of a part's pixels that must show an instance for the part to be its.
        fragment: a part this much smaller than another of its instance joins it.
        divided: share of a part's pixels from which on an instance is an object in it.
        border: parts with a longer common border touch (pixels).
        reach: how far outside an instance a seen point may lie and still be its (voxels).

    Raises:
        ConfigError: shares outside 0..1, or a border or reach that isn't positive.
    """

    def __init__(
        self,
        inner: Completing,
        parts: SeenParts,
        share: float = 0.6,
        fragment: float = 0.15,
        divided: float = 0.3,
        border: int = 25,
        reach: float = 2.0,
    ) -> None:
        if not all(0 <= value <= 1 for value in (share, fragment, divided)):
            raise ConfigError(
                f"share is {share}, fragment {fragment}, divided {divided}; expected 0 to 1"
            )
        if border < 1 or not reach > 0:
            raise ConfigError(f"border is {border}, reach {reach}; expected positive numbers")
        self.inner, self.parts = inner, parts
        self.share, self.fragment, self.divided = share, fragment, divided
        self.border, self.reach = border, reach
        self.grid, self.metadata = inner.grid, inner.metadata

    def reconstruct(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[tuple[Tensor, Tensor]]:
        """`samples` pairs of TSDF (B, X, Y, Z) in metres and instances (B, X, Y, Z) int32."""
        found = self.complete(partial, grid, samples, generator)
        return [(scenes.tsdf, scenes.instances) for scenes in found]

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """Complete scenes with masks of what is seen of each instance.

        Raises:
            InputError: the partial TSDF came without its depth images.
        """
        images = seen_frames(partial, "cutting into parts")
        seen = [(frame, self.parts.segment(frame), world_points(frame)) for frame in images]
        scenes = self.inner.complete(partial, grid, samples, generator)
        return [self._regrouped(sample, seen, grid) for sample in scenes]

    def _regrouped(
        self, sample: Completion, seen: Sequence[tuple[Frame, Int32, Float64]], grid: GridSpec
    ) -> Completion:
        labels = sample.instances.cpu().numpy()
        volumes, masks = [], []
        for instances, (frame, parts, points) in zip(labels, seen, strict=True):
            shown = seen_instances(instances, points, grid, parts > 0, self.reach)
            objects = self.divide(self.join(parts, shown), shown, frame)
            volumes.append(reassigned(instances, shown, objects, points, grid))
            masks.append(objects)
        device = sample.instances.device
        return replace(
            sample,
            instances=torch.from_numpy(np.stack(volumes)).to(device),
            masks=torch.from_numpy(np.stack(masks)).to(device),
        )

    def join(self, parts: Int32, shown: Int32) -> Int32:
        """Parts (H, W) joined to objects, 0 = none, by the instances (H, W) that they show."""
        count = int(parts.max(initial=0)) + 1
        sizes, main = np.bincount(parts.ravel(), minlength=count), np.zeros(count, int)
        for part in range(1, count):
            votes = np.bincount(shown[parts == part])
            votes[0] = 0
            if votes.max() >= self.share * sizes[part]:
                main[part] = votes.argmax()
        touching = borders(parts, count) >= self.border
        same = [
            (a, b)
            for a, b in combinations(np.flatnonzero(main), 2)
            if main[a] == main[b]
            and (not touching[a, b] or _ratio(sizes[a], sizes[b]) < self.fragment)
        ]
        links = coo_matrix((np.ones(len(same)), np.reshape(same, (-1, 2)).T), (count, count))
        joined = connected_components(links, directed=False)[1]
        return np.searchsorted(np.unique(joined), joined)[parts].astype(np.int32)

    def divide(self, objects: Int32, shown: Int32, frame: Frame) -> Int32:
        """Objects (H, W) of which several instances have a large share become several."""
        found, unused = objects.copy(), int(objects.max(initial=0)) + 1
        for label in range(1, unused):
            own = objects == label
            votes = np.bincount(shown[own], minlength=1)
            votes[0] = 0
            large = np.flatnonzero(votes >= max(self.divided * own.sum(), 1))
            if len(large) < 2:
                continue
            pieces = np.zeros_like(objects)
            for number, instance in enumerate(large[1:], start=unused):
                pieces[own & (shown == instance)] = number
            pieces[own & (shown == large[0])] = label
            found[own] = grown(pieces, own, frame.depth)[own]
            found[own & (found == 0)] = label
            unused += len(large) - 1
        return found


def _ratio(first: int, second: int) -> float:
    return min(first, second) / max(first, second)


def borders(parts: Int32, count: int) -> NDArray[np.int64]:
    """Lengths (count, count) of the borders between parts (pixels), symmetric."""
    lengths = np.zeros((count, count), np.int64)
    for a, b in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        differ = parts[a] != parts[b]
        np.add.at(lengths, (parts[a][differ], parts[b][differ]), 1)
    return lengths + lengths.T


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
