"""Frames from arrays, with the checks that images from files get."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageSequence

from scenefw.core.errors import InputError
from scenefw.core.files import unreadable
from scenefw.core.types import Frame, Int32
from scenefw.data.files.frame_assembly import Content, assembled, single_channel
from scenefw.data.files.image_checks import check_colour
from scenefw.data.files.intrinsics import Intrinsics, calibration_of
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.data.files.poses import pose_of

_MAX_BLENDED_RATIO = 0.1
"""Sharp masks of drawn and real objects have up to 0.02, resized ones 0.3 and more."""

_MARKS = (1, 255, 65535)
"""Values that mark pixels in masks of any type, as True does."""


def frame_of(
    depth: ArrayLike,
    intrinsics: Intrinsics,
    colour: ArrayLike | None = None,
    *,
    depth_scale: float | None = None,
    pose: ArrayLike | None = None,
    name: str = "image",
) -> Frame:
    """One frame.

    Args:
        depth: (H, W) or (H, W, 1) z-depth; floats are metres, integers are multiplied by
            `depth_scale`. 0, NaN and infinity are missing measurements.
        intrinsics: of this image size, as `calibration_of` takes them.
        colour: (H, W, 3) uint8, aligned with the depth.
        depth_scale: metres per unit of integer depth; None = 0.001. An error with floats.
        pose: (4, 4) camera (OpenCV) to world; None leaves it at the origin.
        name: of the image, for messages and files.

    Raises:
        InputError: a wrong shape, type or unit, nothing measured, or intrinsics of another image.
        ConfigError: a depth scale that is not positive.
    """
    content = Content(
        _array(depth, "depth", name),
        calibration_of(intrinsics, name),
        colour=None if colour is None else _array(colour, "colour", name),
    )
    frame = assembled(content, depth_scale, name, name)
    if pose is None:
        return frame
    return replace(frame, camera=frame.camera.moved(_rigid(pose, name)))


def mask_of(mask: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.bool_] | Int32:
    """A mask (H, W): booleans say where objects are, int32 which one, 0 = none.

    Args:
        mask: (H, W) or (H, W, 1) booleans or whole numbers; those below 0 are none. A single value
            above 0 says where objects are, as in a picture, if it is of uint8, or 1, 255 or 65535.
        shape: of the image.
        name: of the image, for messages.

    Raises:
        InputError: another shape or type, no pixel is in it, or ids were interpolated.
    """
    values = single_channel(_array(mask, "mask", name))
    if values.shape != tuple(shape):
        raise InputError(
            f"mask of {name} has shape {values.shape}, its depth {tuple(shape)}; both must be "
            f"aligned images of the same size{_of_several(values.shape, shape)}"
        )
    if values.dtype.kind not in "bui":
        raise InputError(
            f"mask of {name} is of {values.dtype}; give booleans, or whole numbers that say which "
            "object a pixel shows (0 = none)"
        )
    if not (values > 0).any():
        raise InputError(f"mask of {name} holds no pixel; leave it out, or mark objects in it")
    if values.dtype == np.bool_:
        return values
    ids = np.unique(values[values > 0])
    blend = blended_ratio(values)
    if blend > _MAX_BLENDED_RATIO:
        raise InputError(
            f"mask of {name} has {len(ids)} values, and {blend:.0%} of its borders pass through "
            "values between those of both sides, as after resizing with interpolation; resize it "
            "with nearest neighbours, or without smooth edges"
        )
    if len(ids) == 1 and (values.dtype == np.uint8 or ids[0] in _MARKS):
        return values > 0
    return np.clip(values, 0, np.iinfo(np.int32).max).astype(np.int32)


def blended_ratio(values: NDArray[Any]) -> float:
    """Share of borders in an image of ids (H, W) where ids go up or down by steps of one pixel.

    Borders of things are sharp; interpolation puts values between both sides.
    """
    steps = borders = 0
    signed = values.astype(np.int64)
    for axis in (0, 1):
        first, second = np.sign(np.diff(signed, axis=axis)), slice(1, None)
        before = first[:-1] if axis == 0 else first[:, :-1]
        after = first[second] if axis == 0 else first[:, second]
        steps += int(((before == after) & (before != 0)).sum())
        borders += int((first != 0).sum())
    return steps / max(borders, 1)


def read_mask(path: Path, shape: tuple[int, ...]) -> NDArray[np.bool_] | Int32:
    """A mask from a picture with one channel of 8 or 16 bits, as `mask_of` gives it.

    A picture of a single value beside 0, such as 255, says where objects are; several values are
    ids of objects.

    Raises:
        InputError: the file is missing, no such picture, of another size, or empty.
    """
    try:
        with Image.open(path) as image:
            if image.mode not in {"1", "L", "P"} and not image.mode.startswith("I"):
                raise InputError(
                    f"mask {path} is a picture of mode {image.mode}; give one channel of 8 or 16 "
                    "bits, 0 = no object"
                )
            pictures = sum(1 for _ in ImageSequence.Iterator(image))
            if pictures > 1:
                raise InputError(f"mask {path} holds {pictures} pictures; {_ONE_IMAGE}")
            image.seek(0)
            values = np.array(image)
    except DAMAGED_PICTURE as error:
        if isinstance(error, FileNotFoundError):
            raise InputError(f"no mask {path}; add it, or leave masks out") from error
        raise InputError(f"cannot read mask {path}: {unreadable(error, 'give a PNG')}") from error
    several = len(np.unique(values[values > 0])) > 1
    return mask_of(values if several else values > 0, shape, path.name)


def colour_of(colour: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.uint8]:
    """Colour (H, W, 3) uint8 of an image.

    Raises:
        InputError: another shape or type.
    """
    return check_colour(_array(colour, "colour", name), shape, name)


def _rigid(pose: ArrayLike, name: str) -> NDArray[np.float64]:
    matrix = _array(pose, "pose", name)
    if matrix.shape != (4, 4) or matrix.dtype.kind not in "uif":
        raise InputError(
            f"pose of {name} has shape {matrix.shape}; give a 4 x 4 matrix, camera to world"
        )
    return pose_of([str(value) for value in matrix.ravel()], f"pose of {name}")


_ONE_IMAGE = "of several masks make one image, 1 where the first object is, 2 where the second is"


def _of_several(masks: tuple[int, ...], image: tuple[int, ...]) -> str:
    """What to do with a stack of masks, first or last axis."""
    stacked = len(masks) == 3 and tuple(image) in (masks[1:], masks[:2])
    return f"; {_ONE_IMAGE}" if stacked else ""


def _array(values: Any, quantity: str, name: str) -> NDArray[Any]:
    try:
        return np.asarray(values)
    except (TypeError, ValueError, RuntimeError) as error:
        kind = type(values).__name__
        raise InputError(
            f"{quantity} of {name} is a {kind} that NumPy can't read; give an array (of a tensor, "
            "tensor.detach().cpu().numpy())"
        ) from error
