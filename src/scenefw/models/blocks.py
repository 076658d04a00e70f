"""Building blocks of the 3D networks: convolution units, SE-residual blocks, reshaping."""

import torch
from torch import Tensor, nn

_TINY = 2  # voxels per side


class Conv3d(nn.Conv3d):
    """Convolution that stays in float32 on volumes of 2^3 voxels or less on the CPU.

    There oneDNN's gradient of bfloat16 weights is NaN at times (torch 2.13, 128 channels), and the
    work is too small to matter.
    """

    def forward(self, volume: Tensor) -> Tensor:
        """Features (B, C, X, Y, Z)."""
        if volume.device.type == "cpu" and max(volume.shape[2:]) <= _TINY:
            with torch.autocast("cpu", enabled=False):
                return super().forward(volume.float())
        return super().forward(volume)


class ConvUnit(nn.Sequential):
    """Convolution, batch normalisation, PReLU.

    Args:
        inputs, outputs: channels.
        stride: 1 keeps the size, 2 halves it.
        kernel: side of the kernel.
        padding: None keeps the size at stride 1.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        *,
        stride: int = 1,
        kernel: int = 3,
        padding: int | None = None,
    ) -> None:
        padding = (kernel - 1) // 2 if padding is None else padding
        super().__init__(
            Conv3d(inputs, outputs, kernel, stride, padding, bias=False),
            nn.BatchNorm3d(outputs),
            nn.PReLU(),
        )


class UpUnit(nn.Sequential):
    """Transposed convolution that doubles the size (stride 1: keeps it), then BN, PReLU."""

    def __init__(self, inputs: int, outputs: int, *, stride: int = 2) -> None:
        super().__init__(
            nn.ConvTranspose3d(inputs, outputs, stride, stride, bias=False),
            nn.BatchNorm3d(outputs),
            nn.PReLU(),
        )


class SqueezeExcitation(nn.Module):
    """Scales channels by a gate computed from their means (Hu et al. 2018).

    Args:
        channels: channels in and out.
        reduction: the gate's hidden layer has channels / reduction units.
    """

    def __init__(self, channels: int, reduction: int = 4) -> None:
        super().__init__()
        hidden = max(channels // reduction, 4)
        self.gate = nn.Sequential(
            nn.Linear(channels, hidden), nn.PReLU(), nn.Linear(hidden, channels), nn.Sigmoid()
        )

    def forward(self, features: Tensor) -> Tensor:
        """Features (B, C, X, Y, Z), scaled."""
        scale = self.gate(features.mean(dim=(2, 3, 4)))
        return features * scale[:, :, None, None, None]


class ResidualBlock(nn.Module):
    """Residual block with squeeze and excitation (He et al. 2016; Hu et al. 2018; fig. 5.19).

    Args:
        channels: channels in and out.
        reduction: of the squeeze-and-excitation gate.
    """

    def __init__(self, channels: int, reduction: int = 4) -> None:
        super().__init__()
        self.body = nn.Sequential(
            ConvUnit(channels, channels),
            Conv3d(channels, channels, 3, padding=1, bias=False),
            nn.BatchNorm3d(channels),
            SqueezeExcitation(channels, reduction),
        )
        self.activation = nn.PReLU()

    def forward(self, features: Tensor) -> Tensor:
        """Features (B, C, X, Y, Z), refined."""
        return self.activation(features + self.body(features))


def space_to_depth(volume: Tensor, factor: int) -> Tensor:
    """Blocks of f^3 voxels become channels: (B, C, X, Y, Z) to (B, C f^3, X/f, Y/f, Z/f)."""
    b, c, x, y, z = volume.shape
    f = factor
    blocks = volume.reshape(b, c, x // f, f, y // f, f, z // f, f)
    return blocks.permute(0, 1, 3, 5, 7, 2, 4, 6).reshape(b, c * f**3, x // f, y // f, z // f)


def depth_to_space(volume: Tensor, factor: int) -> Tensor:
    """The inverse of `space_to_depth`: (B, C f^3, X, Y, Z) to (B, C, f X, f Y, f Z)."""
    b, c, x, y, z = volume.shape
    f = factor
    blocks = volume.reshape(b, c // f**3, f, f, f, x, y, z)
    return blocks.permute(0, 1, 5, 2, 6, 3, 7, 4).reshape(b, c // f**3, x * f, y * f, z * f)
