"""Geometry in full float32, whatever precision a network trains in."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import torch
from torch import Tensor

_DEVICES = ("cpu", "cuda")


@contextmanager
def full_precision() -> Iterator[None]:
    """Within the block, or the function that it decorates, products round to float32 alone.

    Autocast would round the factors of matrix products to 8 bits, so points by millimetres, and
    TF32 on CUDA to 11 bits. Networks bear that, coordinates don't.
    """
    before = torch.get_float32_matmul_precision()
    with ExitStack() as stack:
        for device in _DEVICES:
            if torch.is_autocast_enabled(device):
                stack.enter_context(torch.autocast(device, enabled=False))
        torch.set_float32_matmul_precision("highest")
        try:
            yield
        finally:
            torch.set_float32_matmul_precision(before)


def distances(first: Tensor, second: Tensor) -> Tensor:
    """Distances (..., N, M) of points (..., N, 3) and (..., M, 3), in float32.

    `torch.cdist` takes products of more than 25 points: equal points then lie up to a
    thousandth apart, and with TF32 a hundredth.
    """
    return torch.cdist(first.float(), second.float(), compute_mode="donot_use_mm_for_euclid_dist")
