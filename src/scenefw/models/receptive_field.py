"""The receptive field of a network, read from its layers (thesis eqs 4.12 and 4.13)."""

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import reduce
from typing import Any

import torch
from torch import fx, nn

from scenefw.core.errors import InputError


@dataclass(frozen=True)
class ReceptiveField:
    """Which input pixels an output pixel depends on, along one axis.

    Output pixel i depends on pixels i * stride - before to i * stride + after at most; which of
    them it does differs with i modulo `period` where a network has upsamplings.

    Args:
        stride: input pixels per output pixel.
        before: reach to the left (or up) in input pixels.
        after: reach to the right (or down).
        period: shifts of the input by multiples of it shift the output alike.
    """

    stride: Fraction = Fraction(1)
    before: Fraction = Fraction(0)
    after: Fraction = Fraction(0)
    period: int = 1

    @property
    def size(self) -> int:
        """The r of eq. 4.13."""
        return math.ceil(self.before + self.after) + 1

    @property
    def margin(self) -> int:
        """The longer reach, rounded up to a multiple of the period."""
        return math.ceil(max(self.before, self.after) / self.period) * self.period

    def window(self, kernel: int, stride: int, padding: int, dilation: int) -> "ReceptiveField":
        """After a convolution or pooling: r_l = r_{l-1} + (k - 1) s, s = s_{l-1} s_l."""
        span = dilation * (kernel - 1)
        return ReceptiveField(
            self.stride * stride,
            self.before + padding * self.stride,
            self.after + (span - padding) * self.stride,
            math.lcm(self.period, math.ceil(self.stride * stride)),
        )

    def spread(self, kernel: int, factor: int, padding: int = 0) -> "ReceptiveField":
        """After a transposed convolution or a nearest upsampling, whose kernel is the factor.

        Output j depends on inputs i with j = i factor - padding + (0 .. kernel - 1).
        """
        fine = self.stride / factor
        return replace(
            self,
            stride=fine,
            before=self.before + (kernel - 1 - padding) * fine,
            after=self.after + padding * fine,
        )

    def __or__(self, other: "ReceptiveField") -> "ReceptiveField":
        """Of a sum of two branches: the farther reach on each side."""
        if self.stride != other.stride:
            raise InputError(
                f"branches of strides {self.stride} and {other.stride} meet; expected equal sizes"
            )
        return ReceptiveField(
            self.stride,
            max(self.before, other.before),
            max(self.after, other.after),
            math.lcm(self.period, other.period),
        )


Rule = Callable[[Any, ReceptiveField, int], ReceptiveField]


def receptive_field(network: nn.Module, axis: int = 0) -> ReceptiveField:
    """Follows all paths from the inputs of a network to its output.

    Args:
        network: of convolutions, poolings, upsamplings by whole factors, sums, joined channels and
            layers that work pixel by pixel; torch.fx must be able to trace it.
        axis: 0 = rows, 1 = columns.

    Raises:
        InputError: it has a layer whose reach isn't known here.
    """
    layers = dict(network.named_modules())
    field_of: dict[fx.Node, ReceptiveField] = {}
    for node in fx.Tracer().trace(network).nodes:
        fields = [field_of[n] for n in node.all_input_nodes if n in field_of]
        if node.op == "placeholder":
            field_of[node] = ReceptiveField()
        elif node.op == "call_module":
            field_of[node] = _after(layers[str(node.target)], fields[0], axis)
        elif node.op == "output" or node.target in _MEETINGS:
            field_of[node] = reduce(operator.or_, fields)
        else:
            raise InputError(f"the reach of {node.target} is unknown; expected a layer or a sum")
    return field_of[node]


def _after(layer: nn.Module, before: ReceptiveField, axis: int) -> ReceptiveField:
    for kind, rule in _RULES.items():
        if isinstance(layer, kind):
            return rule(layer, before, axis)
    raise InputError(f"the reach of a layer {type(layer).__name__} is unknown; add it to _RULES")


def _of(value: Any, axis: int) -> int:
    return int(value[axis] if isinstance(value, (tuple, list)) else value)


def _convolution(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    words = (layer.kernel_size, layer.stride, layer.padding, getattr(layer, "dilation", 1))
    return before.window(*(_of(word, axis) for word in words))


def _transposed(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    return before.spread(*(_of(w, axis) for w in (layer.kernel_size, layer.stride, layer.padding)))


def _upsampling(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    factor = _of(layer.scale_factor, axis)
    if layer.mode != "nearest" or factor != layer.scale_factor:
        raise InputError(
            f"the reach of {layer} is unknown; expected nearest upsampling by a whole factor"
        )
    return before.spread(factor, factor)


def _folded(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    return before.window(layer.downscale_factor, layer.downscale_factor, 0, 1)


def _unfolded(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    return before.spread(layer.upscale_factor, layer.upscale_factor)


def _pointwise(layer: Any, before: ReceptiveField, axis: int) -> ReceptiveField:
    return before


_MEETINGS = {operator.add, operator.iadd, torch.add, torch.cat, "add", "add_"}
_RULES: dict[Any, Rule] = {
    (nn.Conv2d, nn.MaxPool2d, nn.AvgPool2d): _convolution,
    nn.ConvTranspose2d: _transposed,
    nn.Upsample: _upsampling,
    nn.PixelUnshuffle: _folded,
    nn.PixelShuffle: _unfolded,
    (nn.modules.batchnorm._BatchNorm, nn.ReLU, nn.PReLU, nn.Identity): _pointwise,
    nn.modules.dropout._DropoutNd: _pointwise,
}
