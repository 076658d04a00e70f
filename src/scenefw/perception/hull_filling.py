"""The strongest reference that learns nothing: parts of a depth image, filled as convex hulls."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from scipy.spatial import ConvexHull, QhullError, cKDTree

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.types import Frame
from scenefw.perception.carving import carve
from scenefw.perception.depth_parts import concave_creases, depth_parts, large_parts
from scenefw.perception.points import world_points
from scenefw.perception.seen_frames import seen_frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.types import Float32, Float64, GridSpec

_PLANES_AT_ONCE = 16
_MOST_POINTS = 1500  # of a part: hulls of more have hundreds of faces and are hardly larger


class HullFilling:
    """Cuts a depth image into parts and fills the convex hull of each down to the floor.

    A part is what is left of the pixels above the floor when they are cut at jumps of depth and
    along concave creases, as no convex object has one. Its hull is that of its points and of their
    footprints on the floor z = 0. Where hulls overlap, the part whose seen points are nearest has
    the voxel. What the view shows to be free is taken away again.

    Args:
        margin: pixels up to this height above the floor belong to it (m).
        jump: neighbouring pixels further apart in depth belong to different parts (m).
        crease: a surface that bends towards the camera by more than this is cut (degrees); 180
            cuts nowhere.
        reach: pixels on either side between which a bend is measured.
        smallest: parts of fewer pixels are dropped.
        grid: of its volumes; None takes that of the other methods that it is compared with.

    Raises:
        ConfigError: a length is not positive, or the reach is below one pixel.
    """

    def __init__(
        self,
        margin: float = 0.01,
        jump: float = 0.02,
        crease: float = 25.0,
        reach: int = 6,
        smallest: int = 200,
        grid: GridSpec | None = None,
    ) -> None:
        if not (margin >= 0 and jump > 0 and crease > 0 and reach >= 1 and smallest >= 1):
            raise ConfigError(
                f"hull filling has margin {margin}, jump {jump}, crease {crease}, reach {reach} "
                f"and smallest {smallest}; expected a margin of at least 0 and the others positive"
            )
        self.margin, self.jump, self.smallest = margin, jump, smallest
        self.crease, self.reach, self.grid = crease, reach, grid
        self.metadata: dict[str, Any] = {}  # of no checkpoint

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """`samples` times the same complete scenes.

        Raises:
            InputError: the partial TSDF came without its depth images.
        """
        device = partial.distance.device
        rows = [self._scene(frame, grid) for frame in seen_frames(partial, "hull filling")]
        tsdf = torch.from_numpy(np.stack([distance for distance, _ in rows])).to(device)
        tsdf = torch.stack([carve(one, partial.of(i), grid) for i, one in enumerate(tsdf)])
        labels = torch.from_numpy(np.stack([owner for _, owner in rows])).to(device)
        instances = torch.where(tsdf < 0, labels, torch.zeros_like(labels))
        return [Completion(tsdf, instances)] * samples

    def parts(self, frame: Frame) -> NDArray[np.int32]:
        """Parts (H, W), 0 = none, of a frame whose camera has its pose (floor z = 0)."""
        above = world_points(frame)[..., 2] > self.margin  # NaN where no depth: not above
        whole = above & ~concave_creases(frame, np.cos(np.radians(self.crease)), self.reach)
        return large_parts(depth_parts(frame.depth, whole, self.jump), self.smallest)

    def _scene(self, frame: Frame, grid: GridSpec) -> tuple[Float32, Any]:
        """Distances (X, Y, Z) metres and the part (X, Y, Z) int32 that each voxel belongs to."""
        labels, points = self.parts(frame), world_points(frame)
        distance = np.full(grid.shape, grid.truncation, np.float32)
        owner = np.zeros(grid.shape, np.int32)
        nearest = np.full(grid.shape, np.inf, np.float32)
        centres = grid.centres()
        for part in range(1, labels.max(initial=0) + 1):
            seen = _thinned(points[labels == part])
            filled = _hull_distance(seen, centres, grid)
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


def _thinned(points: Float64) -> Float64:
    """At most so many points, spread evenly over the image."""
    return points[:: -(-len(points) // _MOST_POINTS)]


def _hull_distance(
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
