"""The reference without learning: what was seen, and nothing else."""

import torch
from torch import Tensor

from scenefw.core.batches import Completion, PartialTSDF
from scenefw.core.protocols import InstanceExtractor
from scenefw.core.types import GridSpec


class PartialSurface:
    """The partial TSDF itself as the scene: only what was seen, nothing completed.

    Unseen space is free, so behind the seen front the surface closes where the fused distances end.
    The evaluation is of objects alone: everything below `clearance` above the floor is cut off,
    which removes the seen floor and the lowest rim of the objects.

    Args:
        extractor: instances of that shape; its votes are all 0.
        clearance: height of the cut above the floor z = 0 (voxels).
    """

    def __init__(self, extractor: InstanceExtractor, clearance: float = 1.0) -> None:
        self.extractor = extractor
        self.clearance = clearance

    @property
    def grid(self) -> None:
        """It takes any."""
        return None

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """`samples` times the same scenes."""
        heights = torch.from_numpy(grid.centres()[0, 0, :, 2]).float()
        cut = (self.clearance * grid.voxel_size - heights).to(partial.distance.device)
        tsdf = torch.maximum(partial.distance[:, 0].float(), cut.clamp(-grid.truncation))
        tsdf = tsdf.clamp(max=grid.truncation)
        return [Completion(tsdf, instances_of(tsdf, self.extractor, grid))] * samples


def instances_of(tsdf: Tensor, extractor: InstanceExtractor, grid: GridSpec) -> Tensor:
    """Instances (B, X, Y, Z) int32 of TSDFs (B, X, Y, Z) without votes."""
    votes = torch.zeros(3, *tsdf.shape[1:], device=tsdf.device)
    return torch.stack([extractor.extract(volume, votes, grid)[0] for volume in tsdf])
