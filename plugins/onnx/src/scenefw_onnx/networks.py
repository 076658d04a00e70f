"""Networks as functions of named tensors, for runtimes that know no scenefw."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import torch
from torch import Tensor, nn

from scenefw.core.errors import CheckpointError
from scenefw.core.training_protocols import ObjectSetModel
from scenefw.learning.checkpoint import OBJECT_SETS, SEGMENTATION, SHAPE_INSTANCE

if TYPE_CHECKING:
    from scenefw.core.object_sets import ObjectSetPrediction
    from scenefw.core.training_protocols import (
        DrawnSetModel,
        SegmentationModel,
        ShapeInstanceModel,
    )
    from scenefw.learning.checkpoint import Checkpoint

BATCH = "batch"
"""Name of the first dimension of every tensor."""


@dataclass(frozen=True)
class NamedNetwork:
    """A network whose inputs and outputs have names.

    Args:
        module: takes the inputs in their order, gives a tuple of the outputs.
        inputs: the names of the dimensions of each; a number is fixed.
        outputs: the same of what it gives.
        example: makes inputs of given sizes from a generator.
        sizes: of the dimensions that may change, other ones each time; the first is for tracing.
        facts: what else must be known to use it, as plain data.
    """

    module: nn.Module
    inputs: Mapping[str, tuple[str | int, ...]]
    outputs: Mapping[str, tuple[str | int, ...]]
    example: Callable[[Mapping[str, int], torch.Generator], tuple[Tensor, ...]]
    sizes: tuple[Mapping[str, int], ...]
    facts: Mapping[str, Any]


def named_network(checkpoint: Checkpoint, task: str) -> NamedNetwork:
    """The test pass of a network.

    Args:
        checkpoint: with the network on the CPU.
        task: what it was trained for.

    Raises:
        CheckpointError: networks for this task have no test pass of one call.
    """
    if task not in _MAKERS:
        raise CheckpointError(
            f"networks for {task} are not exported; expected one for {', '.join(_MAKERS)}"
        )
    return _MAKERS[task](checkpoint)


class _Shapes(nn.Module):
    """Volumes of a view, and of a code where the network has codes."""

    def __init__(self, network: ShapeInstanceModel) -> None:
        super().__init__()
        self.network = network

    def forward(self, condition: Tensor, latent: Tensor | None = None) -> tuple[Tensor, ...]:
        volumes = self.network.predict(condition, latent).volumes
        return tuple(volumes[name] for name in self.network.outputs)


def _shapes(checkpoint: Checkpoint) -> NamedNetwork:
    network: ShapeInstanceModel = checkpoint.model
    if checkpoint.grid is None:
        raise CheckpointError("the file doesn't say which voxel grid its network is for")
    side = checkpoint.grid.shape
    inputs: dict[str, tuple[str | int, ...]] = {"condition": (BATCH, 2, *side)}
    if network.latent_size:
        inputs["latent"] = (BATCH, network.latent_size)

    def example(sizes: Mapping[str, int], generator: torch.Generator) -> tuple[Tensor, ...]:
        view = _views(sizes[BATCH], side, generator)
        codes = torch.randn(sizes[BATCH], network.latent_size, generator=generator)
        return (view, codes) if network.latent_size else (view,)

    return NamedNetwork(
        _Shapes(network),
        inputs,
        {name: (BATCH, channels, *side) for name, channels in network.outputs.items()},
        example,
        ({BATCH: 2}, {BATCH: 1}, {BATCH: 3}),
        {},
    )


class _Labels(nn.Module):
    """Scores of classes."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, colour: Tensor, distance: Tensor) -> tuple[Tensor, ...]:
        return (self.network(colour, distance),)


def _labels(checkpoint: Checkpoint) -> NamedNetwork:
    network: SegmentationModel = checkpoint.model
    stride, metadata = network.stride, checkpoint.metadata
    image: tuple[str | int, ...] = ("height", "width")

    def example(sizes: Mapping[str, int], generator: torch.Generator) -> tuple[Tensor, ...]:
        shape = (sizes["height"], sizes["width"])
        colour = torch.rand(sizes[BATCH], 3, *shape, generator=generator)
        distance = 0.3 * torch.rand(sizes[BATCH], 1, *shape, generator=generator)
        distance[..., : shape[0] // 3, : shape[1] // 4] = torch.nan
        return colour, distance

    sides = ((2, 3 * stride, 4 * stride), (1, 4 * stride + 3, 3 * stride + 1), (3, stride, stride))
    return NamedNetwork(
        _Labels(network),
        {"colour": (BATCH, 3, *image), "distance": (BATCH, 1, *image)},
        {"scores": (BATCH, network.classes, *image)},
        example,
        tuple(dict(zip((BATCH, *map(str, image)), size, strict=True)) for size in sides),
        {key: metadata[key] for key in ("classes", "input", "geometry") if key in metadata}
        | {"window": {"stride": stride, "margin": network.margin}},
    )


class _DecomposingModel(ObjectSetModel, Protocol):
    """A network that always gives the same set (`latent_shape` is empty)."""

    def decompose(self, volume: Tensor) -> ObjectSetPrediction:
        """Of occupancies (B, 1, X, Y, Z), or of conditions (B, 2, X, Y, Z), as `sees` says."""


class _Sets(nn.Module):
    """Objects of a scene or a view."""

    def __init__(self, network: _DecomposingModel, outputs: tuple[str, ...]) -> None:
        super().__init__()
        self.network, self.outputs = network, outputs

    def forward(self, volume: Tensor) -> tuple[Tensor, ...]:
        return _named(self.network.decompose(volume), self.outputs)


class _DrawnSets(nn.Module):
    """Objects of a view and of what was drawn."""

    def __init__(self, network: DrawnSetModel, outputs: tuple[str, ...]) -> None:
        super().__init__()
        self.network, self.outputs = network, outputs

    def forward(self, volume: Tensor, latent: Tensor) -> tuple[Tensor, ...]:
        return _named(self.network.sample(volume, latent), self.outputs)


def _named(prediction: ObjectSetPrediction, outputs: tuple[str, ...]) -> tuple[Tensor, ...]:
    return tuple(getattr(prediction, name) for name in outputs)


def _sets(checkpoint: Checkpoint) -> NamedNetwork:
    network: ObjectSetModel = checkpoint.model
    side = (network.resolution,) * 3
    inputs: dict[str, tuple[str | int, ...]] = {}
    if network.sees == "occupancy":
        inputs["occupancy"] = (BATCH, 1, *side)
    else:
        inputs["condition"] = (BATCH, 2, *side)
    if network.latent_shape:
        inputs["latent"] = (BATCH, *network.latent_shape)
    shapes = {"logits": side, "existence": (), "centres": (3,), "boxes": (2, 3)}
    gives: dict[str, tuple[str | int, ...]] = {
        name: (BATCH, network.slots, *shape)
        for name, shape in shapes.items()
        if name == "logits" or name in network.gives
    }

    def example(sizes: Mapping[str, int], generator: torch.Generator) -> tuple[Tensor, ...]:
        view = _views(sizes[BATCH], side, generator)
        if network.sees == "occupancy":
            view = (view[:, :1] < 0).float()
        latent = torch.randn(sizes[BATCH], *network.latent_shape, generator=generator)
        return (view, latent) if network.latent_shape else (view,)

    kind = _DrawnSets if network.latent_shape else _Sets
    module = kind(checkpoint.model, tuple(gives))
    sizes = ({BATCH: 2}, {BATCH: 1}, {BATCH: 3})
    return NamedNetwork(module, inputs, gives, example, sizes, {})


def _views(count: int, side: tuple[int, ...], generator: torch.Generator) -> Tensor:
    """Partial TSDFs (B, 2, X, Y, Z) of nothing in particular."""
    observed = torch.rand(count, 1, *side, generator=generator) < 0.5
    distance = 2 * torch.rand(count, 1, *side, generator=generator) - 1
    return torch.cat([torch.where(observed, distance, 1.0), observed.float()], dim=1)


_MAKERS: dict[str, Callable[[Checkpoint], NamedNetwork]] = {
    SHAPE_INSTANCE: _shapes,
    SEGMENTATION: _labels,
    OBJECT_SETS: _sets,
}
