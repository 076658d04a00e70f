"""The network: from a partial view to a distribution over numbers of objects."""

from itertools import pairwise

from torch import Tensor, nn

_GROUPS = 4  # of channels that are normalised together


class CountNetwork(nn.Module):
    """Three convolutions of stride 2, their mean over the grid, and two linear layers.

    Args:
        most: largest number of objects that it knows.
        width: channels of the first layer; each further one has twice as many.
    """

    training_only = ()

    def __init__(self, most: int = 8, width: int = 16) -> None:
        super().__init__()
        self.most = most
        self.recipe = {"_target_": f"{__name__}.CountNetwork", "most": most, "width": width}
        widths = (2, width, 2 * width, 4 * width)
        units = [_unit(*pair) for pair in pairwise(widths)]
        self.features = nn.Sequential(*units)
        self.head = nn.Sequential(
            nn.Linear(widths[-1], widths[-1]), nn.SiLU(), nn.Linear(widths[-1], most)
        )

    def forward(self, condition: Tensor) -> Tensor:
        """Scores (B, most) of 1, 2, ... objects from conditions (B, 2, X, Y, Z), for a softmax."""
        features: Tensor = self.features(condition).mean(dim=(2, 3, 4))
        scores: Tensor = self.head(features)
        return scores


def _unit(inner: int, outer: int) -> nn.Module:
    convolution = nn.Conv3d(inner, outer, 3, stride=2, padding=1)
    return nn.Sequential(convolution, nn.GroupNorm(_GROUPS, outer), nn.SiLU())
