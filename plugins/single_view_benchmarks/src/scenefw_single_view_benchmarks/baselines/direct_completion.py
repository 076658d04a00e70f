"""What networks share that complete a view in one pass, without codes."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from torch import nn

from scenefw.core.batches import ShapeInstancePrediction
from scenefw.core.errors import ConfigError, InputError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from typing import Any

    import torch
    from torch import Tensor

    from scenefw.core.batches import ShapeInstanceBatch
    from scenefw.core.protocols import Representation


class DirectCompletion(nn.Module, ABC):
    """A network from a partial TSDF to complete volumes that has no code: one view, one scene.

    Args:
        recipe: its class and plain arguments, which rebuild it.
        resolution: voxels per side, a multiple of `multiple`.
        channels: of the condition that it sees: 1 partial TSDF, 2 also what was observed.
        outputs: channels of each volume, by name.
        multiple: of which the resolution is one.

    Raises:
        ConfigError: a resolution or a number of channels that it can't have.
    """

    training_only: tuple[str, ...] = ()
    latent_size = 0

    def __init__(
        self,
        recipe: dict[str, Any],
        resolution: int,
        channels: int,
        outputs: Mapping[str, int],
        multiple: int,
    ) -> None:
        super().__init__()
        if resolution < multiple or resolution % multiple:
            raise ConfigError(
                f"the network's resolution is {resolution}, expected a multiple of {multiple} "
                "(grid.resolution)"
            )
        if channels not in (1, 2):
            raise ConfigError(f"the condition has 1 or 2 channels, got {channels} (model.channels)")
        self.recipe = {**recipe, "outputs": dict(outputs)}
        self.resolution, self.channels, self.outputs = resolution, channels, dict(outputs)

    @abstractmethod
    def volumes(self, condition: Tensor) -> dict[str, Tensor]:
        """Volumes (B, C, X, Y, Z) by name of conditions (B, channels, X, Y, Z)."""

    def forward(
        self,
        batch: ShapeInstanceBatch,
        generator: torch.Generator | None = None,
        *,
        draw: bool = True,
    ) -> ShapeInstancePrediction:
        """Training pass."""
        return ShapeInstancePrediction(self.volumes(batch.condition[:, : self.channels]))

    def predict(self, condition: Tensor, latent: Tensor | None = None) -> ShapeInstancePrediction:
        """Test pass; `latent` is (B, 0) or None, as there is one scene for each view.

        Raises:
            InputError: the shapes don't fit the network.
        """
        size, shape = (self.resolution,) * 3, tuple(condition.shape)
        if len(shape) != 5 or shape[2:] != size or shape[1] < self.channels:
            raise InputError(
                f"condition has shape {shape}, expected (B, 2, {size[0]}, {size[1]}, {size[2]}); "
                "use the grid of the checkpoint"
            )
        if latent is not None and latent.numel():
            raise InputError("this network has no codes; give none")
        volumes = self.volumes(condition[:, : self.channels])
        if "tsdf" in volumes:
            volumes["tsdf"] = volumes["tsdf"].clamp(-1, 1)
        return ShapeInstancePrediction(volumes, latent=latent)

    def redraws(self, count: int) -> int:
        """No view gets codes."""
        return 0


def channels_of(outputs: Mapping[str, Representation | int]) -> dict[str, int]:
    """Channels of outputs that are given as their representations or as numbers."""
    return {
        name: output if isinstance(output, int) else output.channels
        for name, output in outputs.items()
    }
