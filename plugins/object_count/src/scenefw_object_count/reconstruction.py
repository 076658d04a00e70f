"""Objects of a view by their number: its surface, cut into as many parts as are counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from scipy.spatial.distance import cdist

from scenefw.perception.steps import Objects, ObjectSet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float32, GridSpec, Int32
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import Fits
    from scenefw_object_count.counters import NetworkCounter


class CountedParts:
    """Cuts what is visible into as many parts as a network counts (group `completion`).

    Nothing is completed: shapes are the partial TSDF above the floor. The first sample has the most
    probable number of objects, the others numbers that are drawn from the distribution.

    Args:
        counter: says how many objects there are.
        clearance: everything below this height above the floor z = 0 is cut off (voxels).
    """

    def __init__(self, counter: NetworkCounter, clearance: float = 1.0) -> None:
        self.counter, self.clearance = counter, clearance
        self.metadata = counter.metadata

    @property
    def grid(self) -> GridSpec:
        """That of the network."""
        return self.counter.grid

    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """Scenes with the most probable, and with drawn numbers of objects; needs no fits."""
        partial, grid = view.partial, view.grid
        probabilities = self.counter.probabilities(partial, grid)[0]
        floor = self.clearance * grid.voxel_size - grid.centres()[0, 0, :, 2]
        tsdf = np.maximum(partial.distance[0, 0].float().cpu().numpy(), floor.astype(np.float32))
        tsdf = tsdf.clip(max=grid.truncation)
        draws = torch.multinomial(probabilities, samples, replacement=True, generator=generator)
        draws[0] = probabilities.argmax()
        return [ObjectSet(Objects(None, tsdf, _parts(tsdf, n + 1))) for n in draws.tolist()]


def _parts(tsdf: Float32, count: int) -> Int32:
    """Instances (X, Y, Z) of a TSDF (X, Y, Z), `count` of them."""
    inside = tsdf < 0
    labels = np.zeros(inside.shape, np.int32)
    labels[inside] = _clusters(np.argwhere(inside).astype(np.float64), count) + 1
    return labels


def _clusters(points: NDArray[np.float64], count: int) -> NDArray[np.int32]:
    """A label (N,) of each point, by k-means from starts that are far apart."""
    if len(points) <= count:
        return np.arange(len(points), dtype=np.int32)
    starts = points[[0]]
    while len(starts) < count:
        farthest = cdist(points, starts).min(axis=1).argmax()
        starts = np.concatenate([starts, points[[farthest]]])
    return kmeans2(points, starts, minit="matrix")[1].astype(np.int32)
