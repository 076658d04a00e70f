"""Intrinsics of depth images by a `sensor_msgs/CameraInfo`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import InputError
from scenefw.data.files.intrinsics import (
    Calibration,
    calibration_of,
    camera_from_matrix,
    require_size,
)

if TYPE_CHECKING:
    from scenefw_recordings.topics import Topics


def recorded_calibration(message: Any, topics: Topics, height: int, width: int) -> Calibration:
    """Intrinsics of depth images of a size: P of rectified ones, else K with the distortion D.

    Args:
        message: `sensor_msgs/CameraInfo`.
        topics: of the images and of the message.
        height: of an image (pixels).
        width: of an image (pixels).

    Raises:
        InputError: they are of another size, or no intrinsics.
    """
    try:
        content = _content(message, is_rectified="rect" in topics.depth)
        calibration = calibration_of(content, topics.depth)
        require_size(calibration, height, width, topics.depth)
        camera_from_matrix(calibration.matrix, height, width, topics.depth)
    except InputError as error:
        raise InputError(
            f"{error}; they are of topic {topics.info}: run.info=TOPIC takes another"
        ) from error
    return calibration


def _content(message: Any, *, is_rectified: bool) -> dict[str, Any]:
    """The message as a file of ROS has it, in the pixels of the image.

    K, P, the size and the region are of full resolution there, the region in its pixels, of which
    binning makes one of several (REP 104).
    """
    fields = {name.lower(): value for name, value in vars(message).items()}  # K in ROS 1, k in 2
    x, y = (max(1, int(fields[name])) for name in ("binning_x", "binning_y"))  # 0: none
    projection = np.array(fields["p"], np.float64).reshape(3, 4)[:, :3]
    is_projected = is_rectified and projection[0, 0] > 0
    matrix = projection if is_projected else np.array(fields["k"], np.float64).reshape(3, 3)
    region = fields["roi"]
    content: dict[str, Any] = {
        "K": matrix / [[x], [y], [1]],
        "roi": {
            "x_offset": region.x_offset / x,
            "y_offset": region.y_offset / y,
            "width": int(region.width) // x,
            "height": int(region.height) // y,
        },
    }
    if fields["width"] and fields["height"]:  # 0: not said
        content |= {"width": int(fields["width"]) // x, "height": int(fields["height"]) // y}
    if not is_projected:
        content |= {"D": fields["d"], "distortion_model": fields["distortion_model"]}
    return content
