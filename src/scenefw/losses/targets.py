"""Checks before the work that a loss has its volume."""

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.errors import ConfigError


def require_target(loss: str, target: str, setup: ShapeInstanceSetup, channels: int = 0) -> None:
    """Whether a training has the volume that a loss compares.

    Args:
        loss: its name as an option.
        target: name of a representation.
        setup: of the training.
        channels: that the volume must have; 0: any number.

    Raises:
        ConfigError: it has no volume of this name, or one of another number of channels.
    """
    target_channels = setup.targets.get(target)
    if target_channels is None:
        raise ConfigError(
            f"the loss {loss} compares {target}, but the representations are "
            f"{', '.join(setup.targets)}; add {target} to representation=[...], or leave out the "
            "loss"
        )
    if channels and target_channels != channels:
        raise ConfigError(
            f"the loss {loss} compares volumes of {channels} channels, but {target} has "
            f"{target_channels}; give loss.{loss}.target another representation"
        )


def require_draws(loss: str, setup: ShapeInstanceSetup) -> None:
    """Whether some views of a batch have two drawn codes.

    Raises:
        ConfigError: none has.
    """
    if not setup.redrawn:
        raise ConfigError(
            f"the loss {loss} needs two codes per view, and none of a batch of {setup.batch_size} "
            "has them; raise model.prior_share or the batch, or leave the loss out"
        )
