"""The network's input and truth in its own units."""

from collections.abc import Mapping

import torch
from torch import Tensor

from scenefw.core.batches import PartialTSDF, ShapeInstanceBatch
from scenefw.core.errors import InputError
from scenefw.core.protocols import Representation, SceneBatch
from scenefw.core.types import GridSpec


def condition(partial: PartialTSDF, grid: GridSpec) -> Tensor:
    """The network's input (B, 2, X, Y, Z): distance in units of the truncation, and what was seen.

    Args:
        partial: partial TSDF (m).
        grid: gives the truncation.

    Returns:
        Distances in [-1, 1], then 1 where observed, else 0.
    """
    distance = (partial.distance / grid.truncation).clamp(-1, 1)
    return torch.cat([distance, partial.observed.to(distance.dtype)], dim=1)


def shape_instance_batch(
    partial: PartialTSDF,
    scenes: SceneBatch,
    representations: Mapping[str, Representation],
    *,
    truths: bool = False,
) -> ShapeInstanceBatch:
    """What the network trains on: the condition and the complete scenes, objects alone.

    Args:
        partial: partial TSDFs (m) of the scenes.
        scenes: as they were seen.
        representations: by name.
        truths: also the volumes in the units of their representations.
    """
    volumes = {
        name: representation.of_scenes(scenes) for name, representation in representations.items()
    }
    targets = {
        name: representation.to_network(volumes[name], scenes.grid)
        for name, representation in representations.items()
    }
    return ShapeInstanceBatch(condition(partial, scenes.grid), targets, volumes if truths else {})


def require_grid(of_view: GridSpec, of_network: GridSpec) -> None:
    """Whether a network sees a view on the grid that it was trained on.

    Raises:
        InputError: the grids differ.
    """
    if of_view != of_network:
        raise InputError(
            f"the network was trained on {of_network}, the view is on {of_view}; fuse it on the "
            "checkpoint's grid, or give another checkpoint"
        )
