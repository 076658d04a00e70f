"""Frames of a sequence, read from the files of each."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import unreadable
from scenefw.core.labels import UNKNOWN
from scenefw.data.files import pictures
from scenefw.data.files.exr import read_exr
from scenefw.data.files.intrinsics import read_calibration
from scenefw.data.files.layouts import Surroundings, colour_matrix
from scenefw.data.files.lens import undistorted
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.data.files.readers import read_frame

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.core.types import Frame

IGNORED = 255
"""Value of unknown pixels in an image of labels."""


@dataclass(frozen=True)
class Entry:
    """Number and files of one frame, and its pose, camera to world (4, 4)."""

    number: int
    depth: Path
    colour: Path | None
    labels: Path | None
    pose: NDArray[np.float64] | None


@dataclass(frozen=True)
class FrameFiles:
    """Reads the frames of a list of files; all have the size of the first.

    Args:
        entries: of all frames.
        intrinsics: their file; None = the layout says them.
        depth_scale: metres per unit of integer depth; None = by the layout.
        around: of the depth images.
    """

    entries: list[Entry]
    intrinsics: Path | None
    depth_scale: float | None
    around: Surroundings

    @cached_property
    def size(self) -> tuple[int, int]:
        """Width and height of the first image."""
        return _size_of(self.entries[0].depth)

    def read(self, index: int) -> Frame:
        """A frame.

        Raises:
            InputError: its files are unusable.
        """
        entry = self.entries[index]
        frame = read_frame(
            entry.depth,
            intrinsics=self.intrinsics,
            depth_scale=self.depth_scale,
            around=self.around,
        )
        require_size(frame, *self.size)
        matrix = colour_matrix(self.around.root, entry.depth)
        colour = _colour(entry.colour, frame, matrix)
        labels = None
        if entry.labels is not None:
            labels = _image(entry.labels, "L", frame).astype(np.int32)
            labels[labels == IGNORED] = UNKNOWN
        lens = None if self.intrinsics is None else read_calibration(self.intrinsics).lens
        if lens is not None:
            _, colour, labels = undistorted(  # as `read_frame` has undistorted the depth
                lens, frame.camera.matrix, [frame.depth, colour, labels], frame.name
            )
        camera = frame.camera if entry.pose is None else frame.camera.moved(entry.pose)
        return replace(frame, camera=camera, colour=colour, labels=labels)


def _colour(
    path: Path | None, frame: Frame, matrix: NDArray[np.float64] | None
) -> NDArray[np.uint8] | None:
    """Colour (H, W, 3) of the size of the depth, by its own intrinsics if they are known."""
    if path is None:
        return None
    if matrix is None:
        return _image(path, "RGB", frame)
    return pictures.resampled(path, matrix, frame)


def _size_of(path: Path) -> tuple[int, int]:
    """Width and height of a depth image, from its header if it has one."""
    if path.suffix.lower() == ".exr":
        height, width = read_exr(path).shape
        return width, height
    try:
        if path.suffix.lower() == ".npy":
            height, width = np.load(path, mmap_mode="r", allow_pickle=False).shape[:2]
            return int(width), int(height)
        with Image.open(path) as image:
            return image.size
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {path}: {reason}") from error


def require_size(frame: Frame, width: int, height: int) -> None:
    """Raises an InputError if a frame is of another size."""
    size = (frame.camera.width, frame.camera.height)
    if size != (width, height):
        raise InputError(
            f"frame {frame.name} is {size[0]} x {size[1]} pixels, the first one {width} x "
            f"{height}; all frames of a sequence must have the same size"
        )


def _image(path: Path, mode: str, frame: Frame) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            values = np.array(image.convert(mode))
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {path}: {reason}") from error
    if values.shape[:2] != frame.depth.shape:
        raise InputError(
            f"{path} has shape {values.shape[:2]}, its depth image {frame.depth.shape}; both must "
            "be aligned images of one size"
        )
    return values
