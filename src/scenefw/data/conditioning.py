"""The network's input and truth in its own units."""

import torch
from torch import Tensor

from scenefw.core.batches import PartialTSDF, SceneVolumes, ShapeInstanceBatch
from scenefw.core.types import GridSpec


def condition(partial: PartialTSDF, grid: GridSpec, *, observed: bool) -> Tensor:
    """The network's input (B, C, X, Y, Z) in units of the truncation, in [-1, 1].

    Args:
        partial: partial TSDF (m).
        grid: gives the truncation.
        observed: add a second channel, 1 where observed, else 0 (thesis: False).
    """
    distance = (partial.distance / grid.truncation).clamp(-1, 1)
    if not observed:
        return distance
    return torch.cat([distance, partial.observed.to(distance.dtype)], dim=1)


def training_batch(
    partial: PartialTSDF, volumes: SceneVolumes, grid: GridSpec, *, observed: bool
) -> ShapeInstanceBatch:
    """What the network trains on: the condition and the complete scene, objects alone."""
    tsdf = (volumes.tsdf / grid.truncation).clamp(-1, 1)
    return ShapeInstanceBatch(condition(partial, grid, observed=observed), tsdf, volumes.votes)
