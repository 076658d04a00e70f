"""The reference without learning: what is visible, and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch

from scenefw.core.settings import NOT_NEGATIVE
from scenefw.perception.steps import Objects, ObjectSet

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.protocols import InstanceExtractor
    from scenefw.core.types import GridSpec
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import Fits


class PartialSurface:
    """The partial TSDF itself as the scene: only what is visible, nothing completed.

    Unseen space is free, so behind the visible front the surface closes where the fused distances
    end. The evaluation is of objects alone: everything below `clearance` above the floor is cut
    off, which removes the visible floor and the lowest rim of the objects.

    Args:
        extractor: instances of that shape; its votes are all 0.
        clearance: height of the cut above the floor z = 0 (voxels).
    """

    grid: GridSpec | None = None

    def __init__(self, extractor: InstanceExtractor, clearance: float = 1.0) -> None:
        NOT_NEGATIVE.require(clearance=clearance)
        self.extractor, self.clearance = extractor, clearance
        self.metadata: dict[str, Any] = {}  # of no checkpoint

    def complete(
        self, fits: Fits, view: Observation, samples: int, generator: torch.Generator
    ) -> list[ObjectSet]:
        """`samples` times the same scene; fits count for nothing."""
        partial, grid = view.partial, view.grid
        heights = torch.tensor(grid.centres()[0, 0, :, 2], dtype=torch.float32)
        cut_distance = (self.clearance * grid.voxel_size - heights).to(partial.distance.device)
        tsdf = torch.maximum(partial.distance[0, 0].float(), cut_distance.clamp(-grid.truncation))
        tsdf = tsdf.clamp(max=grid.truncation)
        instances = instances_of(tsdf, self.extractor, grid).cpu().numpy()
        return [ObjectSet(Objects(None, tsdf.cpu().numpy(), instances))] * samples


def instances_of(tsdf: Tensor, extractor: InstanceExtractor, grid: GridSpec) -> Tensor:
    """Instances (X, Y, Z) int32 of a TSDF (X, Y, Z; m) without votes."""
    votes = torch.zeros(3, *tsdf.shape, device=tsdf.device)
    return extractor.extract(tsdf, votes, grid)[0]
