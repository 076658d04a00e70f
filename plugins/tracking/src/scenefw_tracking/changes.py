"""What an image shows of a known scene that has changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.geometry import inverse, transform_points
from scenefw.perception.evidence.mesh_distances import distances_to
from scenefw.perception.observation.components import EDGE, depth_parts, neighbours
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import MAJORITY, camera_points
from scenefw_tracking.depth_memory import smallest_change
from scenefw_tracking.tracks import masks_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from numpy.typing import NDArray

    from scenefw.core.types import Camera, Float32, Float64, Frame, Int32, TriangleMesh
    from scenefw_tracking.depth_memory import DepthMemory
    from scenefw_tracking.tracks import Track

    Mask = NDArray[np.bool_]

CHANGED = 1
"""Region of an image that has changed; others are of objects beside it."""


@dataclass(frozen=True, eq=False)
class Change:
    """Which pixels of an image show something else than before.

    Args:
        depth: (H, W) metres, of the image.
        memory: of what pixels have shown.
        nearer: (H, W) that show something in front of what they have shown.
        farther: (H, W) that show something behind it.
        contradicted: ids of objects behind which they show something.
        is_total: most of the image has changed, or most of several objects.
    """

    depth: Float32
    memory: DepthMemory
    nearer: Mask
    farther: Mask
    contradicted: frozenset[int]
    is_total: bool

    @classmethod
    def of(cls, depth: Float32, memory: DepthMemory, tracks: Iterable[Track]) -> Change:
        """The change from what pixels, and tracks of objects, remember."""
        nearer, farther = memory.nearer(depth), memory.farther(depth)
        comparable = max(int(np.count_nonzero((depth > 0) & (memory.upper > 0))), 1)
        ratio = int(np.count_nonzero(nearer) + np.count_nonzero(farther)) / comparable
        visible = {t.id: t.visible_part for t in tracks if t.visible_part is not None}
        contradicted = {i for i, part in visible.items() if part.is_contradicted(depth)}
        many_moved = 1 < len(contradicted) > MAJORITY * len(visible)
        is_total = ratio > MAJORITY or many_moved
        return cls(depth, memory, nearer, farther, frozenset(contradicted), is_total)

    @property
    def is_none(self) -> bool:
        """Whether all is as it was."""
        return not (self.contradicted or self.nearer.any() or self.farther.any())

    def regions(
        self, objects: Mask, tracks: Iterable[Track], points: Float64
    ) -> tuple[frozenset[int], Int32]:
        """Objects that need another look, and the regions (H, W) to reconstruct anew.

        An object needs another look that is contradicted, of which more has come to light, or
        beside which something has appeared that is no farther from it than noise is.
        Region `CHANGED` are components of depth without still objects, some of whose pixels have
        changed. Still objects that touch it have a region each: what they carry goes down to them.

        Args:
            objects: (H, W) pixels of this image that show objects.
            tracks: of all objects.
            points: (H, W, 3) of this image, in the coordinates of the tracks (m).
        """
        visible = {t.id: t for t in tracks if t.visible_part is not None}
        ids = set(self.contradicted)
        while True:
            labels = masks_of((t for t in visible.values() if t.id not in ids), self.depth)
            candidates = objects & (labels == 0)
            changed = self.nearer | self.farther | self._places(visible, ids)
            parts = depth_parts(self.depth, candidates, EDGE)
            numbers = np.unique(parts[changed & candidates])
            revealed = self.memory.cleaned(self.farther & candidates)
            again = _beside(revealed, labels, self.depth)
            for number in numbers:
                part = parts == number
                again |= {
                    label
                    for label in _beside(part, labels, self.depth)
                    if self._continues(part, visible[label], points)
                }
            if not again - ids:
                break
            ids |= again
        pixels = np.isin(parts, numbers) & candidates
        touching = np.isin(labels, list(_beside(pixels, labels, self.depth))) & objects
        return frozenset(ids), np.where(pixels, CHANGED, np.where(touching, labels + CHANGED, 0))

    def _places(self, visible: Mapping[int, Track], ids: Collection[int]) -> Mask:
        """Pixels (H, W) that have shown objects."""
        places = np.zeros(self.depth.shape, bool)
        for label in ids & visible.keys():
            part = visible[label].visible_part
            if part is not None:
                places[part.box] |= part.pixels
        return places

    def _continues(self, part: Mask, track: Track, points: Float64) -> bool:
        """Whether all of a part (H, W) lies as near to an object as noise does: it has moved."""
        places = points[part][:: coarse_step(part.shape[1]) ** 2]
        limit = float(smallest_change(self.depth[part], self.memory.sigma).max())
        distances = distances_to(track.item.mesh).at(places, 2 * limit)
        return bool((np.abs(distances) <= limit).all())


def _beside(pixels: Mask, labels: Int32, depth: Float32) -> set[int]:
    """Labels of neighbours (H, W) of pixels, on the same surface."""
    beside: set[int] = set()
    for a, b in neighbours():
        for first, second in ((a, b), (b, a)):
            linked = pixels[first] & (np.abs(depth[first] - depth[second]) < EDGE)
            beside |= set(np.unique(labels[second][linked]).tolist())
    return beside - {0}


def stands_still(frame: Frame, memory: DepthMemory, T_world_camera: Float64) -> bool:  # noqa: N803
    """Whether a camera of another pose would see what it has seen, within a pixel and its noise.

    Args:
        frame: what it has seen, with its pose.
        memory: of that.
        T_world_camera: 4x4, the other pose.
    """
    camera, motion = frame.camera, inverse(T_world_camera) @ frame.camera.T_world_camera
    if (motion == np.eye(4)).all():
        return True
    step = coarse_step(camera.width)
    before = camera_points(frame, step)
    measured = np.isfinite(before[..., 2])
    after = transform_points(motion, before[measured])
    shift = _pixels(camera, after) - _pixels(camera, before[measured])
    depth = after[:, 2].astype(np.float32)
    sampled = memory[np.s_[::step, ::step]]
    same_depth = (depth >= sampled.lower[measured]) & (depth <= sampled.upper[measured])
    return bool(same_depth.all() and np.abs(shift).max(initial=0) < memory.reach)


def is_seen_through(mesh: TriangleMesh, frame: Frame, memory: DepthMemory) -> bool:
    """Whether an image shows what is behind a mesh, at most of its vertices.

    Args:
        mesh: in world coordinates.
        frame: with its pose.
        memory: of its depth.
    """
    camera = frame.camera
    points = transform_points(inverse(camera.T_world_camera), mesh.vertices)
    points = points[points[:, 2] > 0]
    column, row = np.rint(_pixels(camera, points)).astype(int).T
    inside = (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    free = points[inside, 2] < memory.lower[row[inside], column[inside]]
    free &= frame.depth[row[inside], column[inside]] > 0
    return bool(np.count_nonzero(free) > MAJORITY * len(mesh.vertices))


def _pixels(camera: Camera, points: Float64) -> Float64:
    """Columns and rows (N, 2) of points (N, 3) in a camera's coordinates."""
    return points[:, :2] / points[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)
