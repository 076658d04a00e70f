"""Objects that contradict the image give way to what is visible of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from scenefw.core.geometry import bounds, within
from scenefw.core.types import TriangleMesh
from scenefw.core.weak_cache import cached_by_identity
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.evidence.mesh_distances import distances_to, mesh_volumes
from scenefw.perception.evidence.object_depth import object_depth
from scenefw.perception.observation.components import DETAIL, TOUCH
from scenefw.perception.observation.image_turns import turned_pixels
from scenefw.perception.observation.object_masks import footprint_hull
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import MIN_POINTS, MINORITY, points_by_label
from scenefw.shapes.moments import moments
from scenefw.shapes.vessel import Vessel

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from scenefw.core.types import Float32, Float64, ObjectEstimate, SceneEstimate
    from scenefw.perception.observation.observation import Observation

_MAX_LENGTH_RATIO = 2.0  # to that of what is visible


def plausible(estimate: SceneEstimate, view: Observation) -> SceneEstimate:
    """The scene with humbler shapes in place of those that contradict the image.

    A shape contradicts it that lies below the floor, before what was measured, hovers, or is far
    longer than what is visible of it. In its place comes the first of these that doesn't, or the
    best: the hull of visible points and of their footprints on what they stand on, or on the floor;
    columns below visible points.

    Args:
        estimate: with masks.
        view: with its image.
    """
    if estimate.masks is None or view.image is None:
        return estimate
    checks = _Checks(estimate, view)
    changes = {}
    for item in estimate.objects:
        flaws = checks.flaws_of(item)
        for mesh in checks.humbler(item.id) if flaws else ():
            humbler_flaws = checks.flaws(mesh, item.id, moments(mesh).volume)
            if humbler_flaws < flaws:
                changes[item.id], flaws = mesh, humbler_flaws
            if not flaws:
                break
    return with_meshes(estimate, changes) if changes else estimate


def with_meshes(estimate: SceneEstimate, meshes: dict[int, TriangleMesh]) -> SceneEstimate:
    """The scene with other meshes, closed, for some of its objects, and their volumes."""
    is_old = np.isin(estimate.instances, list(meshes))
    tsdf = np.where(is_old, np.float32(estimate.grid.truncation), estimate.tsdf)
    distances, labels = mesh_volumes(list(meshes.items()), estimate.grid)
    is_new = (distances < tsdf) & (is_old | (estimate.instances == 0))
    instances = np.where(is_old, 0, estimate.instances)
    instances = np.where(is_new & (distances < 0), labels, instances)
    tsdf = np.where(is_new, distances, tsdf)
    return replace(
        estimate,
        objects=objects_with(estimate.objects, meshes),
        tsdf=tsdf.astype(np.float32),
        instances=instances.astype(np.int32),
    )


def objects_with(
    objects: Sequence[ObjectEstimate], meshes: Mapping[int, TriangleMesh]
) -> tuple[ObjectEstimate, ...]:
    """Objects, some of which have other closed meshes, by id, and no shape."""
    confidences = {item.id: item.confidence for item in objects if item.id in meshes}
    shown = {label: mesh for label, mesh in meshes.items() if label in confidences}
    changed = {item.id: item for item in estimate_objects(shown, confidences)}
    return tuple(changed.get(item.id, item) for item in objects)


@cached_by_identity
def _hulls(_view: Observation) -> dict[tuple[bytes, float], TriangleMesh | None]:
    """Hulls by their visible points and the height of what they stand on, for all hypotheses."""
    return {}


class _Checks:
    """What an image says about shapes of its objects."""

    def __init__(self, estimate: SceneEstimate, view: Observation) -> None:
        self.objects, self.camera, self.hulls = estimate.objects, view.camera, _hulls(view)
        self.margin = estimate.grid.voxel_size
        self.depth: Float32 = view.depth
        if view.source is not None:
            self.depth = turned_pixels(view.source.depth, view.turns)
        self.stride = coarse_step(view.camera.width)
        self.depth = self.depth[:: self.stride, :: self.stride]
        masks = estimate.masks
        assert masks is not None
        measured_masks = np.where(np.isfinite(view.points[..., 2]), masks, 0)
        self.visible = dict.fromkeys((item.id for item in estimate.objects), np.empty((0, 3)))
        self.visible |= points_by_label(measured_masks, view.points)

    def flaws_of(self, item: ObjectEstimate) -> float:
        """`flaws` of an object; a vessel's volume is that of what it may hold, too.

        Its walls are so thin that errors of depth along its rim alone are much of theirs.
        """
        shape = None if item.placed is None else item.placed.shape
        if isinstance(shape, Vessel):
            return self.flaws(item.mesh, item.id, shape.filled_volume())
        return self.flaws(item.mesh, item.id, moments(item.mesh).volume)

    def flaws(self, mesh: TriangleMesh, label: int, volume: float) -> float:
        """0 if a closed mesh contradicts nothing; else in how many ways, and how much.

        Args:
            mesh: of an object.
            label: of the object.
            volume: to which that in free space is compared (m^3).
        """
        lowest = float(mesh.vertices[:, 2].min())
        flaws = float(-lowest > self.margin)
        visible = self.visible[label]
        if len(visible) > MIN_POINTS:
            length, visible_length = (
                np.subtract(*bounds(points)[::-1]).max() for points in (mesh.vertices, visible)
            )
            flaws += float(length > _MAX_LENGTH_RATIO * visible_length)
        free = self._free_volume(mesh) / max(volume, np.finfo(float).tiny)
        flaws += min(free, 1.0) if free > MINORITY else 0.0
        return flaws + float(lowest > TOUCH and self._hovers(mesh, label))

    def humbler(self, label: int) -> Iterator[TriangleMesh]:
        """Closed meshes of what is visible of an object, the boldest first."""
        points = self.visible[label]
        if len(points) <= MIN_POINTS:
            return
        support = self._support(label, points)
        for height in dict.fromkeys((support, 0.0)):
            key = points.tobytes(), height
            if key not in self.hulls:
                hull = footprint_hull(points - (0, 0, height))
                self.hulls[key] = hull and TriangleMesh(hull.vertices + (0, 0, height), hull.faces)
            mesh = self.hulls[key]
            if mesh is not None:
                yield mesh
        yield columns_below(points, support)

    def _support(self, label: int, points: Float64) -> float:
        """Height (m) of what lies below the visible points (N, 3): another object, or the floor."""
        middle, lowest = np.median(points[:, :2], axis=0)[None], points[:, 2].min()
        heights = [
            distances_to(item.mesh).highest(middle)[0]
            for item in self.objects
            if item.id != label
            and (distances_to(item.mesh).low[:2] < middle).all()
            and (distances_to(item.mesh).high[:2] > middle).all()
        ]
        return max([float(h) for h in heights if h < lowest + self.margin], default=0.0)

    def _free_volume(self, mesh: TriangleMesh) -> float:
        """Volume of a mesh (m^3) that lies before what was measured, by more than a voxel.

        A ray counts up to where it leaves the mesh for the first time, with the volume of its
        pixel's pyramid: the integral of depth^2 over depth, by both focal lengths.
        """
        depth = object_depth(mesh, self.camera)
        measured = self.depth[depth.box]
        end = np.where(measured > 0, np.minimum(depth.back, measured - self.margin), 0.0)
        pyramids = np.maximum(end**3 - depth.front**3, 0.0).sum() / 3
        return float(pyramids * self.stride**2 / (self.camera.fx * self.camera.fy))

    def _hovers(self, mesh: TriangleMesh, label: int) -> bool:
        """Whether nothing is close to the lowest part of a mesh."""
        heights = mesh.vertices[:, 2]
        bottom = mesh.vertices[heights < heights.min() + TOUCH]
        low, high = bounds(bottom)
        low, high = low - TOUCH, high + TOUCH
        neighbours = [
            vertices[within(vertices, low, high)]
            for item in self.objects
            for solid, vertices in [(distances_to(item.mesh), item.mesh.vertices)]
            if item.id != label and (solid.low <= high).all() and (solid.high >= low).all()
        ]
        places = np.concatenate([np.empty((0, 3)), *neighbours])
        distances = cKDTree(bottom).query(places, distance_upper_bound=TOUCH)[0]
        return not (distances < TOUCH).any()


def columns_below(points: Float64, floor: float) -> TriangleMesh:
    """The solid of columns, `DETAIL` wide, between a level and the highest of points (N, 3)."""
    low = points.min(axis=0) - 2 * DETAIL
    low[2] = floor
    cells = np.floor((points - low) / DETAIL).astype(int)
    counts = cells.max(axis=0) + 3
    top = np.zeros(counts[:2], dtype=int)
    np.maximum.at(top, (cells[:, 0], cells[:, 1]), np.maximum(cells[:, 2], 1))
    filled = np.arange(counts[2])[None, None] <= top[..., None]
    filled = np.pad(filled & (top[..., None] > 0), 1)
    vertices, faces, _, _ = marching_cubes(filled.astype(np.float32), 0.5)
    return TriangleMesh(low + (vertices - 0.5) * DETAIL, faces[:, ::-1].astype(np.int64))
