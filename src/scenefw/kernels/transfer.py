"""Small arrays to the device, in one copy that nothing waits for."""

from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_ALIGNMENT = 16  # bytes


def to_device(arrays: Sequence[NDArray], device: torch.device | str) -> list[Tensor]:
    """Arrays as tensors on a device, ready in the order of its stream.

    On CUDA they travel in one block of pinned memory: copies of pageable memory make the host wait
    for all that the device still has to do.
    """
    device = torch.device(device)
    if device.type == "cpu":
        return [torch.from_numpy(np.ascontiguousarray(array)) for array in arrays]
    packed = pack(arrays)
    # torch keeps a pinned block until the copy out of it is done
    pinned = torch.empty(packed.shape, dtype=torch.uint8, pin_memory=device.type == "cuda")
    pinned.copy_(torch.from_numpy(packed))
    return unpack(pinned.to(device, non_blocking=True), arrays)


def pack(arrays: Sequence[NDArray]) -> NDArray[np.uint8]:
    """The bytes of arrays one after the other, each from a multiple of 16 on."""
    ends = np.cumsum([_padded(array) for array in arrays])
    packed = np.zeros(ends[-1], np.uint8)
    for array, end in zip(arrays, ends, strict=True):
        start = end - _padded(array)
        packed[start : start + array.nbytes] = np.frombuffer(array.tobytes(), np.uint8)
    return packed


def unpack(packed: Tensor, like: Sequence[NDArray]) -> list[Tensor]:
    """Views of the bytes of `pack` as tensors of the types and shapes of the arrays."""
    tensors, start = [], 0
    for array in like:
        dtype = torch.from_numpy(np.empty(0, array.dtype)).dtype
        tensor = torch.empty(array.shape, dtype=dtype, device=packed.device)
        if array.size:
            tensor = packed[start : start + array.nbytes].view(dtype).view(array.shape)
        tensors.append(tensor)
        start += _padded(array)
    return tensors


def _padded(array: NDArray) -> int:
    return -(-array.nbytes // _ALIGNMENT) * _ALIGNMENT
