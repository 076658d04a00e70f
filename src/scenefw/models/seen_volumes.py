"""What networks of sets may see: a complete scene, or one view of it."""

from torch import Tensor

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetBatch

CHANNELS = {"occupancy": 1, "view": 2}
"""Of the complete occupancy, or of distances and what was observed."""


def require_sees(sees: str) -> None:
    """Whether there is such a thing to see.

    Raises:
        ConfigError: there is not.
    """
    if sees not in CHANNELS:
        raise ConfigError(f"model.sees is {sees!r}; expected {' or '.join(CHANNELS)}")


def seen_volume(batch: ObjectSetBatch, sees: str) -> Tensor:
    """What a network sees of a batch (B, C, X, Y, Z)."""
    return batch.occupancy if sees == "occupancy" else batch.condition


def require_volume(volume: Tensor, sees: str, resolution: int) -> None:
    """Whether a volume is what a network sees.

    Raises:
        InputError: it has another shape.
    """
    expected_shape = (CHANNELS[sees], *(resolution,) * 3)
    if tuple(volume.shape[1:]) != expected_shape:
        raise InputError(
            f"the network sees volumes (B, {', '.join(map(str, expected_shape))}), got "
            f"{tuple(volume.shape)}; use the grid of the checkpoint"
        )
