"""Pictures from outside: what reading them may raise, and colour in the pixels of depth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import DAMAGED, unreadable

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Frame

DAMAGED_PICTURE = (*DAMAGED, Image.DecompressionBombError)
"""As `DAMAGED`, and of pictures so large that PIL takes them for an attack."""


def resampled(path: Path, matrix: Float64, frame: Frame) -> NDArray[np.uint8]:
    """Colour (H, W, 3) in the pixels of a frame's depth, seen from the same place.

    Args:
        path: the picture, of any size.
        matrix: (3, 3) its own intrinsics.
        frame: with depth and its camera.

    Raises:
        InputError: it is damaged.
    """
    camera = frame.camera
    (fx, _, cx), (_, fy, cy) = matrix[:2]
    # PIL takes pixel corners: output (x, y) to input (a x + b y + c, d x + e y + f)
    across, down = fx / camera.fx, fy / camera.fy
    left = cx + 0.5 - (camera.cx + 0.5) * across
    top = cy + 0.5 - (camera.cy + 0.5) * down
    box = (left, top, left + across * camera.width, top + down * camera.height)
    try:
        with Image.open(path) as image:
            colour = image.convert("RGB")
            clipped = (
                max(box[0], 0.0), max(box[1], 0.0),
                min(box[2], float(colour.width)), min(box[3], float(colour.height)),
            )  # fmt: skip
            if clipped == box or np.allclose(clipped, box, atol=1.0):
                size = (camera.width, camera.height)
                return np.array(colour.resize(size, Image.Resampling.BOX, clipped))
            data = (across, 0.0, left, 0.0, down, top)
            return np.array(
                colour.transform(
                    (camera.width, camera.height),
                    Image.Transform.AFFINE,
                    data,
                    Image.Resampling.BILINEAR,
                )
            )
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {path}: {reason}") from error
