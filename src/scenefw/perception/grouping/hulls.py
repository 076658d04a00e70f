"""The strongest reference that learns nothing: parts of a depth image, filled as convex hulls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.spatial import ConvexHull, QhullError, cKDTree

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.perception.estimate.carving import carve
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.view_frames import seen_frames

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.protocols import PartFinder
    from scenefw.core.types import Float32, Float64, Frame, GridSpec, Int32
    from scenefw.postprocessing.confidence import Calibration

_PLANES_AT_ONCE = 16
_MOST_POINTS = 1500  # of a part: hulls of more have hundreds of faces and are hardly larger


class HullFilling:
    """Fills the convex hull of each part of a depth image down to the floor.

    A hull is that of a part's points and of their footprints on the floor z = 0. Where hulls
    overlap, the part whose seen points are nearest has the voxel. What the view shows to be free is
    taken away again.

    Args:
        parts: of the image; None: those that come with the partial TSDF.
        grid: of its volumes; None takes that of the other methods that it is compared with.
    """

    calibration: Calibration | None = None

    def __init__(self, parts: PartFinder | None, grid: GridSpec | None = None) -> None:
        self.parts, self.grid = parts, grid
        self.metadata: dict[str, Any] = {}  # of no checkpoint

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """`samples` times the same complete scenes.

        Raises:
            InputError: the partial TSDF came without its depth images.
            ConfigError: nothing looks for parts, and it came without them.
        """
        device = partial.distance.device
        frames = seen_frames(partial, "hull filling")
        rows = [
            self._scene(frame, parts, grid)
            for frame, parts in zip(frames, self._parts(partial, frames), strict=True)
        ]
        tsdf = torch.from_numpy(np.stack([distance for distance, _ in rows])).to(device)
        tsdf = torch.stack([carve(one, partial.of(i), grid) for i, one in enumerate(tsdf)])
        labels = torch.from_numpy(np.stack([owner for _, owner in rows])).to(device)
        instances = torch.where(tsdf < 0, labels, torch.zeros_like(labels))
        return [Completion(tsdf, instances)] * samples

    def _parts(self, partial: PartialTSDF, frames: Sequence[Frame]) -> Iterable[Int32]:
        if self.parts is not None:
            return map(self.parts.segment, frames)
        if partial.parts is None:
            raise ConfigError("hull filling needs parts of the image; give its setting parts")
        return partial.parts.cpu().numpy()

    def _scene(self, frame: Frame, labels: Int32, grid: GridSpec) -> tuple[Float32, Any]:
        """Distances (X, Y, Z) metres and the part (X, Y, Z) int32 that each voxel belongs to."""
        points = world_points(frame)
        distance = np.full(grid.shape, grid.truncation, np.float32)
        owner = np.zeros(grid.shape, np.int32)
        nearest = np.full(grid.shape, np.inf, np.float32)
        centres = grid.centres()
        for part in np.unique(labels[labels > 0]):  # numbers may have gaps
            seen = thinned(points[labels == part])
            filled = hull_distance(seen, centres, grid)
            if filled is None:
                continue
            box, values = filled
            distance[box] = np.minimum(distance[box], values)
            inside = values < 0
            apart = np.full(values.shape, np.inf, np.float32)
            apart[inside] = cKDTree(seen).query(centres[box][inside])[0]
            closer = apart < nearest[box]
            owner[box][closer] = part
            nearest[box] = np.minimum(nearest[box], apart)
        return distance, owner


def thinned(points: Float64) -> Float64:
    """At most so many points, spread evenly over the image."""
    return points[:: -(-len(points) // _MOST_POINTS)]


def hull_distance(
    seen: Float64, centres: Float64, grid: GridSpec
) -> tuple[tuple[slice, ...], Float32] | None:
    """The box around a part's hull and distances (m) there; None if the hull has no volume.

    Outside and beside edges the distance is that to the farthest plane, a lower bound.
    """
    points = np.concatenate([seen, seen * (1, 1, 0)])
    try:
        planes = np.unique(ConvexHull(points).equations, axis=0)  # of triangles, many share one
    except QhullError:  # all points in one plane
        return None
    reach = grid.truncation
    low = np.floor(grid.to_voxels(points.min(axis=0) - reach)).astype(int)
    high = np.ceil(grid.to_voxels(points.max(axis=0) + reach)).astype(int) + 1
    ends = np.clip([low, high], 0, grid.resolution)
    box = tuple(slice(a, b) for a, b in ends.T)
    places = centres[box]
    if not places.size:
        return None
    heights = _farthest(planes, places.reshape(-1, 3), reach).reshape(places.shape[:-1])
    return box, np.clip(heights, -reach, reach).astype(np.float32)


def _farthest(planes: Float64, places: Float64, reach: float) -> Float64:
    """Height (P,) of each place above the plane that is farthest below it, or `reach` or more.

    Most places are soon known to be out of reach, and the further planes are left out for them.
    """
    heights, todo = np.full(len(places), -np.inf), np.arange(len(places))
    for some in np.array_split(planes, -(-len(planes) // _PLANES_AT_ONCE)):
        found = (places[todo] @ some[:, :3].T + some[:, 3]).max(axis=1)
        heights[todo] = np.maximum(heights[todo], found)
        todo = todo[heights[todo] < reach]
    return heights
