"""Labels of maps of any size, window by window, equal to those of one pass over the whole map."""

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from scenefw.core.memory import available_memory
from scenefw.core.settings import COUNT, POSITIVE

LEAST, MOST, UNKNOWN = 128, 4096, 512
"""Megabytes taken at least and at most, and where nothing says what is free."""


@dataclass(frozen=True)
class Window:
    """One pass along one axis: pixels `first` to `last` go in, `begin` to `end` are kept."""

    first: int
    last: int
    begin: int
    end: int


class SlidingWindow:
    """Runs a network over windows that overlap by the context their borders lack (thesis 4.7.3).

    Windows of d pixels lie o = d - 2 r apart (eq. 4.11). With r the receptive field, as in the
    thesis, that is more than enough: a pixel depends on no more than half of it to either side, so
    here r is the longer reach of the actual layers, rounded up to a multiple of the network's
    total stride. The rounding, and d a multiple of it too, let every window begin where the
    network's coarsest cells begin in a pass over everything; else strided layers would look at
    other pixels. Borders of the map are those of its outer windows, padded as in one pass.

    Args:
        memory: megabytes that the features of one window may take; None follows what is free where
            the network runs. Results are the same but for rounding.
        window: d in pixels instead, rounded up to fit; None takes what the memory holds.

    Raises:
        ConfigError: either is 0 or less.
    """

    def __init__(self, memory: float | None = None, window: int | None = None) -> None:
        POSITIVE.require(memory=memory)
        COUNT.require(window=window)
        self.memory, self.window = memory, window

    @torch.inference_mode()
    def probabilities(self, network: nn.Module, colour: Tensor, distance: Tensor) -> Tensor:
        """Probabilities (C, H, W) on the CPU.

        Args:
            network: a `SegmentationModel`, in eval mode.
            colour: (3, H, W) in [0, 1].
            distance: (1, H, W) metres, NaN = missing.
        """
        height, width = colour.shape[1:]
        margin = network.margin
        device = next(network.parameters()).device
        side = self._side(network, margin, device)
        result = torch.empty(network.classes, height, width)
        for rows in windows(height, side, margin):
            for columns in windows(width, side, margin):
                input_region = (
                    ...,
                    slice(rows.first, rows.last),
                    slice(columns.first, columns.last),
                )
                output_region = (
                    ...,
                    slice(rows.begin, rows.end),
                    slice(columns.begin, columns.end),
                )
                inner = (
                    ...,
                    slice(rows.begin - rows.first, rows.end - rows.first),
                    slice(columns.begin - columns.first, columns.end - columns.first),
                )
                scores = network(
                    colour[input_region][None].to(device), distance[input_region][None].to(device)
                )
                result[output_region] = scores[0][inner].softmax(dim=0).float().cpu()
        return result

    def _side(self, network: nn.Module, margin: int, device: torch.device) -> int:
        """The window's side d: a multiple of the stride, wide enough to keep a quarter of it."""
        stride = network.stride
        if self.window is not None:
            side = -(-self.window // stride) * stride
        else:
            memory = free_megabytes(device) if self.memory is None else self.memory
            pixels = memory * 1e6 / bytes_per_pixel(network)
            side = int(pixels**0.5) // stride * stride
        return max(side, 4 * margin, stride)


def free_megabytes(device: torch.device) -> int:
    """Megabytes for a window: a quarter of what is free, from LEAST to MOST.

    A power of 2, so that windows, and with them the last bits of a result, are those of other
    runs unless memory is a good deal scarcer.
    """
    if device.type == "cuda":
        cached_bytes = torch.cuda.memory_reserved(device) - torch.cuda.memory_allocated(device)
        free = torch.cuda.mem_get_info(device)[0] + cached_bytes  # torch keeps what it has freed
    else:
        free = available_memory() if device.type == "cpu" else None
    if free is None:
        return UNKNOWN
    quarter = max(int(free / 4e6), 1)
    return min(max(1 << quarter.bit_length() - 1, LEAST), MOST)


def windows(size: int, side: int, margin: int) -> Iterator[Window]:
    """Windows along an axis of `size` pixels; what they keep covers it once.

    Args:
        size: of the map.
        side: of a window, d.
        margin: on either side of what is kept, r; o = d - 2 r pixels are kept.
    """
    begin = 0
    while begin < size:
        first = max(begin - margin, 0)
        last = min(first + side, size)
        end = size if last == size else last - margin
        yield Window(first, last, begin, end)
        begin = end


@torch.inference_mode()
def bytes_per_pixel(network: nn.Module) -> float:
    """Bytes of all features of a pass over an image, per pixel: an upper bound on what is alive."""
    total, side = 0, 8 * network.stride

    def count(_module: nn.Module, _inputs: object, output: Tensor) -> None:
        nonlocal total
        total += output.numel() * output.element_size()

    leaves = [m for m in network.modules() if not list(m.children())]
    hooks = [m.register_forward_hook(count) for m in leaves]
    try:
        device = next(network.parameters()).device
        network(
            torch.zeros(1, 3, side, side, device=device),
            torch.zeros(1, 1, side, side, device=device),
        )
    finally:
        for hook in hooks:
            hook.remove()
    return total / side**2
