"""A depth image as Python code gives it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from scenefw.core.assets import image_path
from scenefw.core.errors import InputError, require_number
from scenefw.data.files.arrays import colour_of, frame_of, mask_of
from scenefw.data.files.readers import read_frame

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from scenefw.core.types import Frame, Int32
    from scenefw.data.files.intrinsics import Intrinsics


def image_of(
    depth: ArrayLike | str | Path,
    intrinsics: Intrinsics | None,
    color: ArrayLike | None,
    mask: ArrayLike | None,
    depth_scale: float | None,
    name: str,
) -> tuple[Frame, NDArray[np.bool_] | Int32 | None]:
    """The frame and the mask (H, W) of arguments as `Predictor.predict` takes them.

    Raises:
        InputError: the image is unusable.
    """
    require_number(depth_scale, "depth_scale", "metres per unit of integer depth, or None")
    frame = _frame(depth, intrinsics, color, depth_scale, name)
    if mask is None:
        return frame, None
    values = mask_of(mask, frame.depth.shape, frame.name)
    return frame, values if frame.undistort is None else frame.undistort(values)


def _frame(
    depth: ArrayLike | str | Path,
    intrinsics: Intrinsics | None,
    colour: ArrayLike | None,
    scale: float | None,
    name: str,
) -> Frame:
    if isinstance(depth, str | Path):
        frame = read_frame(image_path(depth), intrinsics=intrinsics, depth_scale=scale)
        if colour is None:
            return frame
        return replace(frame, colour=colour_of(colour, frame.depth.shape, frame.name))
    if intrinsics is None:
        raise InputError(
            f"no intrinsics of {name}; give K (3, 3), or the numbers fx, fy, cx, cy in pixels"
        )
    return frame_of(depth, intrinsics, colour, depth_scale=scale, name=name)
