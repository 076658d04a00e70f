"""Frames of what a file or a caller holds: units, placeholders, size and lens settled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.types import Camera, Float32, Frame
from scenefw.data.files.image_checks import (
    Stored,
    check_colour,
    check_depth,
    metres,
    placeholders,
    unit_of,
)
from scenefw.data.files.intrinsics import Calibration, camera_from_matrix, require_size
from scenefw.data.files.layouts import MILLIMETRES, TUM_UNIT
from scenefw.data.files.lens import Lens, undistorted

_NEAREST_TUM_MEDIAN = 0.3
"""Cameras of the TUM benchmark measure from 0.4 m on: a median below (m) tells another unit."""


@dataclass(frozen=True, eq=False)
class Content:
    """What a file or a caller holds of an image.

    Args:
        depth: (H, W) or (H, W, 1), in any unit.
        calibration: of its camera.
        unit: metres per unit of integer depth where nothing else says it.
        colour: (H, W, 3) uint8.
        labels: (H, W).
        notes: lines that its frame carries.
        in_millimetres: depth is of an array `depth_mm`, whose unit no setting changes.
    """

    depth: NDArray[Any]
    calibration: Calibration
    unit: float = MILLIMETRES
    colour: NDArray[Any] | None = None
    labels: NDArray[Any] | None = None
    notes: tuple[str, ...] = ()
    in_millimetres: bool = False


def assembled(content: Content, scale: float | None, file: str, name: str) -> Frame:
    """The frame of an image; its camera stands at the origin.

    Args:
        content: of its file.
        scale: metres per unit of integer depth that the caller gave; None = as the file says.
        file: its name, for messages.
        name: of the frame.

    Raises:
        InputError: a wrong shape, type or unit, nothing measured, or intrinsics of another image.
        ConfigError: a scale that is not positive.
    """
    values = single_channel(content.depth)
    calibration, notes = content.calibration, list(content.notes)
    unit = content.unit
    if calibration.depth_scale is not None and scale is None and values.dtype.kind in "ui":
        unit = unit_of(calibration.depth_scale, values, file)
    depth = metres(values, scale, file, unit)
    depth, placeholder_notes = _without_placeholders(
        depth, values, unit if scale is None else scale
    )
    notes += placeholder_notes
    depth = check_depth(depth, file, _stored_as(content, unit if scale is None else scale))
    if scale is None and unit == TUM_UNIT and values.dtype.kind in "ui":
        notes += _tum_notes(depth)
    height, width = depth.shape
    camera = camera_from_matrix(calibration.matrix, height, width, file)
    require_size(calibration, height, width, file)
    colour = None if content.colour is None else check_colour(content.colour, depth.shape, file)
    labels = content.labels
    if labels is not None and labels.shape != depth.shape:
        raise InputError(
            f"labels of {file} has shape {labels.shape}, its depth {depth.shape}; both must be "
            "aligned images of the same size"
        )
    if calibration.lens is None:
        return Frame(depth, camera, colour, labels, name, tuple(notes))
    lens, distorted_depth = calibration.lens, depth
    depth, colour, labels = undistorted(lens, camera.matrix, [depth, colour, labels], file)
    notes.append(
        f"the image was undistorted by its {lens.model} coefficients; if it is rectified already, "
        "set them to 0"
    )

    undistort = partial(_undistorted_beside, lens, camera, distorted_depth, file)
    return Frame(depth, camera, colour, labels, name, tuple(notes), undistort)


def _undistorted_beside(
    lens: Lens, camera: Camera, depth: Float32, file: str, image: NDArray[Any]
) -> NDArray[Any]:
    """Another image (H, W) of the pixels of a distorted depth image."""
    undistorted_image: NDArray[Any] = undistorted(lens, camera.matrix, [depth, image], file)[1]
    return undistorted_image


def _stored_as(content: Content, unit: float) -> Stored:
    if content.in_millimetres:
        return Stored(MILLIMETRES, "depth_mm")
    return Stored(unit, None) if content.depth.dtype.kind in "ui" else Stored()


def single_channel(values: NDArray[Any]) -> NDArray[Any]:
    """An image (H, W) of (H, W, 1); all else as it is."""
    return values[..., 0] if values.ndim == 3 and values.shape[2] == 1 else values


def _without_placeholders(
    depth: NDArray[np.float32], values: NDArray[Any], unit: float
) -> tuple[NDArray[np.float32], list[str]]:
    """Depth (H, W) with 0 for values that stand for "no measurement", and a line that says so."""
    fillers = placeholders(depth)
    if not fillers:
        return depth, []
    words = " and ".join(_stored(filler, values, unit) for filler in fillers)
    note = (
        f"depth of {words} counts as not measured: many pixels share it exactly, and nothing "
        "beside them is near; store 0 there"
    )
    is_filler = np.isin(depth, np.array(fillers, np.float32))
    return np.where(is_filler, np.float32(0), depth), [note]


def _stored(metres_: float, values: NDArray[Any], unit: float) -> str:
    """A depth as its file has it."""
    return f"{metres_ / unit:.0f}" if values.dtype.kind in "ui" else f"{metres_:.6g} m"


def _tum_notes(depth: NDArray[np.float32]) -> list[str]:
    median = float(np.median(depth[depth > 0]))
    if median >= _NEAREST_TUM_MEDIAN:
        return []
    return [
        f"in the unit of the TUM benchmark, 1/5000 m, the median depth is {median:.2f} m, in "
        f"millimetres {median * MILLIMETRES / TUM_UNIT:.2f} m; if depth is in millimetres, give "
        "run.depth_scale=0.001"
    ]
