"""Which volume a metric compares: found missing before the work."""

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.errors import ConfigError


def require_volume(metric: str, target: str, setup: ShapeInstanceSetup) -> None:
    """Whether a training has the volume that a metric compares.

    Args:
        metric: its name as an option.
        target: name of a representation.
        setup: of the training.

    Raises:
        ConfigError: it has no volume of this name.
    """
    if target not in setup.targets:
        raise ConfigError(
            f"the metric {metric} compares {target}, but the representations are "
            f"{', '.join(setup.targets)}; leave it out, such as metric=[], or give "
            f"metric.{metric}.target"
        )
