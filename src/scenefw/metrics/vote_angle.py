"""Angle between predicted and true centre votes, to watch a training by."""

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.nn import functional

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.types import GridSpec
from scenefw.metrics.volumes import require_volume


class VoteAngle:
    """Mean angle (degrees) of the zero code's votes to the true ones, inside objects.

    Args:
        target: name of the representation of votes.
    """

    of_samples = False

    def __init__(self, target: str = "votes") -> None:
        self.target = target

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError if the training has no such volume."""
        require_volume("vote_degrees", self.target, setup)

    def __call__(
        self, predicted: Mapping[str, Tensor], true: Mapping[str, Tensor], grid: GridSpec
    ) -> Tensor:
        """Degrees; 0 without objects."""
        votes, truth = functional.normalize(predicted[self.target], dim=1), true[self.target]
        cosine = (votes * truth).sum(dim=1).clamp(-1, 1)
        inside = truth.square().sum(dim=1) > 0.5
        angle = torch.rad2deg(cosine.acos()) * inside
        return angle.sum() / inside.sum().clamp(min=1)
