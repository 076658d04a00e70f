"""Absolute error of any predicted volume, to watch a training by."""

from collections.abc import Mapping

from torch import Tensor

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.types import GridSpec
from scenefw.metrics.volumes import require_volume


class AbsoluteError:
    """Mean absolute difference of the zero code's volume and the true one.

    Args:
        target: name of the representation.
        in_truncations: of distances (m): in units of the truncation.
    """

    of_samples = False

    def __init__(self, target: str = "tsdf", *, in_truncations: bool) -> None:
        self.target, self.in_truncations = target, in_truncations

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_volume(self.target, self.target, setup)

    def __call__(
        self, predicted: Mapping[str, Tensor], true: Mapping[str, Tensor], grid: GridSpec
    ) -> Tensor:
        """In the units of the representation, or in truncations."""
        error = (predicted[self.target].float() - true[self.target].float()).abs().mean()
        return error / grid.truncation if self.in_truncations else error
