"""FuseNet-style labelling network: colour and depth encoders, fused at every layer."""

from collections.abc import Sequence
from functools import cached_property

import torch
from torch import Tensor, nn
from torch.nn import functional

from scenefw.core.errors import ConfigError
from scenefw.core.settings import POSITIVE, below
from scenefw.models.receptive_field import receptive_field
from scenefw.models.recipes import recipe_of

MODALITIES = ("colour", "distance")


class ConvModule(nn.Sequential):
    """Convolution 3 x 3, batch normalisation, ReLU; stride 2 halves the size."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1) -> None:
        super().__init__(
            nn.Conv2d(inputs, outputs, 3, stride, 1, bias=False),
            nn.BatchNorm2d(outputs),
            nn.ReLU(inplace=True),
        )


class UpModule(nn.Module):
    """One upsampling and two convolutions; the encoder's features join after the upsampling.

    Args:
        inputs: channels from below.
        skipped: channels of the encoder's features of the doubled size.
        outputs: channels.
    """

    def __init__(self, inputs: int, skipped: int, outputs: int) -> None:
        super().__init__()
        self.up = nn.Upsample(scale_factor=2, mode="nearest")
        self.first = ConvModule(inputs + skipped, outputs)
        self.second = ConvModule(outputs, outputs)

    def forward(self, below: Tensor, skip: Tensor) -> Tensor:
        """(B, C, H, W) and (B, D, 2H, 2W) to (B, outputs, 2H, 2W)."""
        return self.second(self.first(torch.cat([self.up(below), skip], dim=1)))


class FuseNetBody(nn.Module):
    """The layers of `FuseNet`, for images whose sides are multiples of its stride.

    Args:
        classes: channels of the result.
        widths: channels of each level, the finest first; each next level has half the size.
        modules: convolutional modules per level of each encoder.
        dropout: share of features dropped where a level ends, and before the classes.
        block: pixels per side that become channels of the first layers, and again of the result.
    """

    def __init__(
        self,
        classes: int,
        widths: Sequence[int],
        modules: Sequence[int],
        dropout: float,
        block: int = 1,
    ) -> None:
        super().__init__()
        self.fold, self.unfold = nn.PixelUnshuffle(block), nn.PixelShuffle(block)
        self.colour = _encoder(3 * block**2, widths, modules)
        self.depth = _encoder(2 * block**2, widths, modules)
        self.ends = frozenset(sum(modules[: n + 1]) - 1 for n in range(len(modules)))
        self.drop = nn.Dropout(dropout)
        # The finest first, so that a network of one level more has the same names, and one more
        levels = zip(widths[1:], widths[:-1], strict=True)
        self.decoder = nn.ModuleList(UpModule(low, high, high) for low, high in levels)
        self.classify = nn.Conv2d(widths[0], classes * block**2, 1)

    def forward(self, colour: Tensor, depth: Tensor) -> Tensor:
        """Scores (B, classes, H, W) of colour (B, 3, H, W) and depth with its mask (B, 2, H, W)."""
        colour, depth, skips = self.fold(colour), self.fold(depth), []
        for number, (colours, depths) in enumerate(zip(self.colour, self.depth, strict=True)):
            depth = depths(depth)
            colour = colours(colour) + depth  # fig. 4.19: fused at every layer
            if number in self.ends:
                skips.append(colour)
        features = self.drop(skips.pop())
        for module in reversed(self.decoder):
            features = module(features, skips.pop())
        return self.unfold(self.classify(self.drop(features)))


class FuseNet(nn.Module):
    """Labels each pixel from colour and a distance (Hazirbas et al. 2016; thesis 4.7.1, fig. 4.19).

    Two encoders of equal shape, one of colour and one of depth (views) or height (maps), whose
    features are added after every convolutional module; features of every level skip to the
    decoder. Missing distances are 0 after normalisation, and a mask channel says which they are.

    The result moves with its input by multiples of `stride`, apart from a border as wide as the
    receptive field reaches. Sides that are no multiple of it are padded with zeros below and on
    the right, which a window that ends there pads alike.

    Args:
        classes: number of classes.
        widths: channels of each level, the finest first; each next level has half the size.
        modules: convolutional modules per level of each encoder; the thesis has 8 in all.
        dropout: share of features dropped in training, at the coarsest level and before the end.
        offset: distance (m) that becomes 0.
        scale: distance (m) from there that becomes 1.
        block: pixels per side that are moved to channels before the first layer and back after the
            last: with 2, all layers have a quarter of the pixels (Shi et al. 2016).
        modalities: what it looks at, of `colour` and `distance`; the other is zero, to learn what
            one alone is worth.
    """

    training_only = ()

    def __init__(
        self,
        classes: int,
        widths: Sequence[int],
        modules: Sequence[int],
        dropout: float = 0.1,
        offset: float = 0.0,
        scale: float = 0.1,
        block: int = 1,
        modalities: Sequence[str] = MODALITIES,
    ) -> None:
        super().__init__()
        if classes < 2 or len(widths) != len(modules) or min(*widths, *modules) < 1:
            raise ConfigError(
                f"FuseNet has classes = {classes}, widths = {list(widths)}, modules = "
                f"{list(modules)}; expected 2 classes or more, and as many widths as modules"
            )
        POSITIVE.require(scale=scale)
        below(1).require(dropout=dropout)
        if block < 1 or not modalities or not set(modalities) <= set(MODALITIES):
            raise ConfigError(
                f"FuseNet has block = {block}, modalities = {list(modalities)}; expected at least "
                f"1 pixel, and one or both of {', '.join(MODALITIES)}"
            )
        self.classes, self.offset, self.scale = classes, offset, scale
        self.modalities = tuple(name for name in MODALITIES if name in modalities)
        self.stride = block * 2 ** (len(widths) - 1)
        self.body = FuseNetBody(classes, widths, modules, dropout, block)
        self.recipe = recipe_of(self, {**locals(), "modalities": self.modalities})

    @cached_property
    def margin(self) -> int:
        """The longer reach of the layers to a side, rounded up to a multiple of `stride`."""
        return max(receptive_field(self.body, axis).margin for axis in (0, 1))

    def forward(self, colour: Tensor, distance: Tensor) -> Tensor:
        """Scores (logits) of the classes, (B, classes, H, W).

        Args:
            colour: (B, 3, H, W) in [0, 1].
            distance: (B, 1, H, W) depth or height (m), NaN = missing.
        """
        height, width = colour.shape[-2:]
        padding = (0, -width % self.stride, 0, -height % self.stride)
        # Pictures have a deviation of about 1/4
        colour = functional.pad((colour - 0.5) * 4, padding)
        valid = torch.isfinite(distance)
        units = torch.where(valid, (distance - self.offset) / self.scale, 0.0)
        depth = functional.pad(torch.cat([units, valid.to(units.dtype)], dim=1), padding)
        if "colour" not in self.modalities:
            colour = torch.zeros_like(colour)
        if "distance" not in self.modalities:
            depth = torch.zeros_like(depth)
        return self.body(colour, depth)[..., :height, :width]


def _encoder(inputs: int, widths: Sequence[int], modules: Sequence[int]) -> nn.ModuleList:
    layers = []
    for level, (width, count) in enumerate(zip(widths, modules, strict=True)):
        for number in range(count):
            layers.append(ConvModule(inputs, width, 2 if level and not number else 1))
            inputs = width
    return nn.ModuleList(layers)
