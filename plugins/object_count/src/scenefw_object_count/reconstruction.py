"""Objects of a view by their number: the seen surface, cut into as many parts as are counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.cluster.vq import kmeans2
from scipy.spatial.distance import cdist

from scenefw.core.batches import Completion

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.batches import PartialTSDF
    from scenefw.core.types import GridSpec
    from scenefw_object_count.counters import NetworkCounter


class CountedParts:
    """Cuts what was seen into as many parts as a network counts (group `reconstructor`).

    Nothing is completed: shapes are the partial TSDF above the floor. The first sample has the most
    probable number of objects, the others numbers that are drawn from the distribution.

    Args:
        counter: says how many objects there are.
        clearance: everything below this height above the floor z = 0 is cut off (voxels).
    """

    calibration = None  # how right it is by how alike its samples are was not measured

    def __init__(self, counter: NetworkCounter, clearance: float = 1.0) -> None:
        self.counter, self.clearance = counter, clearance
        self.metadata = counter.metadata

    @property
    def grid(self) -> GridSpec:
        """That of the network."""
        return self.counter.grid

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """Scenes of B partial views with the most probable, and with drawn numbers of objects."""
        probabilities = self.counter.probabilities(partial, grid)
        heights = torch.from_numpy(grid.centres()[0, 0, :, 2]).float()
        floor = (self.clearance * grid.voxel_size - heights).to(partial.distance.device)
        tsdf = torch.maximum(partial.distance[:, 0].float(), floor).clamp(max=grid.truncation)
        draws = torch.multinomial(probabilities, samples, replacement=True, generator=generator)
        draws[:, 0] = probabilities.argmax(dim=1)
        return [Completion(tsdf, _parts(tsdf, counts + 1)) for counts in draws.T]


def _parts(tsdf: Tensor, counts: Tensor) -> Tensor:
    """Instances (B, X, Y, Z) int32 of TSDFs (B, X, Y, Z), `counts` (B,) in each."""
    inside = (tsdf < 0).cpu().numpy()
    labels = np.zeros(inside.shape, np.int32)
    for mask, row, count in zip(inside, labels, counts.tolist(), strict=True):
        row[mask] = _clusters(np.argwhere(mask).astype(np.float64), count) + 1
    return torch.from_numpy(labels).to(tsdf.device)


def _clusters(points: NDArray[np.float64], count: int) -> NDArray[np.int32]:
    """A label (N,) of each point, by k-means from starts that are far apart."""
    if len(points) <= count:
        return np.arange(len(points), dtype=np.int32)
    starts = points[[0]]
    while len(starts) < count:
        farthest = cdist(points, starts).min(axis=1).argmax()
        starts = np.concatenate([starts, points[[farthest]]])
    return kmeans2(points, starts, minit="matrix")[1].astype(np.int32)
