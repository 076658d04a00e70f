"""Data of networks that cut depth images into parts, as torch tensors.

torch is imported for type checkers only, so that these can be named without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch


@dataclass(frozen=True)
class PartViewBatch:
    """B depth images of scenes, and which object each pixel shows.

    Args:
        depth: (B, H, W) z-depth in metres, with the floor, 0 = no measurement.
        owners: (B, H, W) int32, 0 = the floor or nothing, others = an object or an obstacle.
        cameras: one per image.
        obstacles: (B, H, W) bool, where the owner is no object; None: all owners are objects.
        colour: (B, 3, H, W) from 0 to 1, NaN in images without; None: no image has any.
    """

    depth: Tensor
    owners: Tensor
    cameras: CameraBatch
    obstacles: Tensor | None = None
    colour: Tensor | None = None


@dataclass(frozen=True)
class PartViewSetup:
    """What losses may check before a training on parts of images starts.

    Args:
        width: pixels of the images.
        height: pixels of the images.
        shown: whether the network says which pixels show objects.
    """

    width: int
    height: int
    shown: bool
