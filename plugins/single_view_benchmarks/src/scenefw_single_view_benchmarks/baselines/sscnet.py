"""SSCNet** (Song et al. 2017, adapted): a baseline for shape alone."""

from collections.abc import Mapping

import torch
from torch import Tensor, nn

from scenefw.core.errors import ConfigError
from scenefw.core.protocols import Representation
from scenefw.models.blocks import Conv3d, ConvUnit, depth_to_space
from scenefw_single_view_benchmarks.baselines.direct_completion import DirectCompletion, channels_of

_LARGEST = 7  # kernel of the first layer


class SSCNet(DirectCompletion):
    """SSCNet with its receptive field of dilated layers, predicting distances (thesis fig. 5.15).

    As in the thesis, the last layer gives a TSDF instead of classes, convolutions are padded, the
    pooling is left out, and one upsampling makes up for the stride of the first layer. It predicts
    no votes: find instances as connected components.

    Args:
        resolution: voxels per side, even.
        channels: of the condition that it sees: 1 partial TSDF, 2 also what was observed.
        width: channels of the first layer; later ones have 2, 4 and 8 times as many. 16 in the
            paper.
        outputs: volumes that it predicts, by name: their representations, or their numbers of
            channels.

    Raises:
        ConfigError: no width, or an odd resolution.
    """

    def __init__(
        self,
        resolution: int,
        outputs: Mapping[str, Representation | int],
        channels: int = 2,
        width: int = 16,
    ) -> None:
        if width < 1:
            raise ConfigError(f"model.width is {width}, expected at least 1")
        recipe = {
            "_target_": f"{__name__}.{type(self).__name__}",
            "resolution": resolution,
            "channels": channels,
            "width": int(width),
        }
        super().__init__(recipe, resolution, channels, channels_of(outputs), 2)
        wide = 4 * width
        self.first = ConvUnit(channels, width, stride=2, kernel=_LARGEST)
        self.near = nn.Sequential(_Residual(width, 2 * width), _Residual(2 * width, wide))
        self.middle = _Residual(wide, wide)
        self.far = nn.ModuleList([_Residual(wide, wide, dilation=2) for _ in range(2)])
        self.joined = nn.Sequential(
            ConvUnit(4 * wide, 2 * wide, kernel=1), ConvUnit(2 * wide, 2 * wide, kernel=1)
        )
        self.last = Conv3d(2 * wide, 8 * sum(self.outputs.values()), 1)

    def volumes(self, condition: Tensor) -> dict[str, Tensor]:
        """Volumes (B, C, X, Y, Z) by name."""
        scales = [self.near(self.first(condition))]
        for block in (self.middle, *self.far):
            scales.append(block(scales[-1]))
        volume = depth_to_space(self.last(self.joined(torch.cat(scales, dim=1))), 2)
        parts = volume.split(list(self.outputs.values()), dim=1)
        return dict(zip(self.outputs, parts, strict=True))


class _Residual(nn.Module):
    """Two convolutions and a way around them."""

    def __init__(self, inputs: int, outputs: int, dilation: int = 1) -> None:
        super().__init__()
        options = {"padding": dilation, "dilation": dilation, "bias": False}
        self.body = nn.Sequential(
            Conv3d(inputs, outputs, 3, **options), nn.BatchNorm3d(outputs), nn.PReLU(),
            Conv3d(outputs, outputs, 3, **options), nn.BatchNorm3d(outputs),
        )  # fmt: skip
        self.around = nn.Identity() if inputs == outputs else Conv3d(inputs, outputs, 1)
        self.activation = nn.PReLU()

    def forward(self, features: Tensor) -> Tensor:
        output: Tensor = self.activation(self.around(features) + self.body(features))
        return output
