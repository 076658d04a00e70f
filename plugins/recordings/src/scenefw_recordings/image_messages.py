"""Depth and colour of ROS messages with images, raw or compressed."""

from __future__ import annotations

import io
import struct
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import unreadable
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw_recordings.rvl import decode_rvl

if TYPE_CHECKING:
    from numpy.typing import NDArray

CHANNELS = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2], "bgra8": [2, 1, 0]}
"""Places of red, green and blue in pixels, by encoding."""

_DEPTH = {"16UC1": np.uint16, "mono16": np.uint16, "32FC1": np.float32}
_PNG = b"\x89PNG"
_HEADER = struct.Struct("<iff")
"""Of compressedDepth: how it is compressed, and the two numbers by which floats were inverted."""
_RVL_SIZE = struct.Struct("<II")  # columns and rows


def is_compressed(message: Any) -> bool:
    """Whether a message is a `CompressedImage`."""
    return str(message.__msgtype__).endswith("/CompressedImage")


def depth_of(message: Any, topic: str) -> NDArray[Any]:
    """Depth (H, W) of a message with an image, raw, or compressed as PNG or RVL; 0 = none.

    Floats are in metres, whole numbers in the unit of the recording.

    Args:
        message: `sensor_msgs/Image` or `CompressedImage`.
        topic: for messages.

    Raises:
        InputError: an encoding that isn't depth, or a damaged image.
    """
    if is_compressed(message):
        return _decompressed(message, topic)
    kind = _DEPTH.get(message.encoding)
    if kind is None:
        raise InputError(
            f"{topic} is encoded as {message.encoding}; expected one of {', '.join(_DEPTH)}"
        )
    return _rows(message, np.dtype(kind), 1, topic)[..., 0]


def _decompressed(message: Any, topic: str) -> NDArray[Any]:
    """Of a `CompressedImage`, as compressed_depth_image_transport or image_transport write it."""
    encoding, _, method = (part.strip() for part in message.format.partition(";"))
    data = bytes(message.data)
    header = 0 if data.startswith(_PNG) else _HEADER.size
    if "rvl" in method.lower():
        values = _rvl_image(data[header:], topic)
    elif data[header:].startswith(_PNG):
        values = _picture(data[header:], topic)
    else:
        raise InputError(
            f"{topic} is compressed as '{message.format}'; expected depth as PNG or RVL, or raw "
            "images"
        )
    if values.ndim != 2:
        raise InputError(f"{topic} holds pictures of colour; give run.depth=TOPIC of depth")
    if encoding == "32FC1" and header:
        return _from_inverse(values, data)
    if values.dtype.itemsize < 2:
        raise InputError(f"{topic} has 8 bits per pixel; give run.depth=TOPIC of depth in 16 bits")
    return values


def _from_inverse(values: NDArray[Any], data: bytes) -> NDArray[np.float32]:
    """Depth (H, W) m that was stored as A / depth + B in 16 bits, 0 = none."""
    _, a, b = _HEADER.unpack_from(data)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = a / (values.astype(np.float64) - b)
    return np.where((values > 0) & np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)


def _rvl_image(data: bytes, topic: str) -> NDArray[np.uint16]:
    try:
        width, height = _RVL_SIZE.unpack_from(data)
        return decode_rvl(data[_RVL_SIZE.size :], width * height).reshape(height, width)
    except (struct.error, ValueError) as error:
        raise InputError(f"an image of {topic} is damaged: {error}; record it again") from error


def colour_of(message: Any, topic: str) -> NDArray[np.uint8]:
    """Colours (H, W, 3) of a message with an image, raw or compressed.

    Raises:
        InputError: an unknown encoding.
    """
    if is_compressed(message):
        return _picture(bytes(message.data), topic, "RGB").astype(np.uint8)
    order = CHANNELS.get(message.encoding)
    if order is None:
        raise InputError(
            f"{topic} is encoded as {message.encoding}; expected one of {', '.join(CHANNELS)}"
        )
    channels = 4 if "a" in message.encoding else 3
    return np.ascontiguousarray(_rows(message, np.dtype(np.uint8), channels, topic)[..., order])


def _rows(message: Any, kind: np.dtype[Any], channels: int, topic: str) -> NDArray[Any]:
    """Pixels (H, W, channels); rows of messages may be longer than their pixels."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    row_bytes = width * channels * kind.itemsize
    data = np.frombuffer(bytes(message.data), np.uint8)
    if step < row_bytes or len(data) < height * step:
        raise InputError(
            f"an image of {topic} has {len(data)} bytes in rows of {step}, which is too little for "
            f"{width} x {height} pixels of {message.encoding}"
        )
    rows = data[: height * step].reshape(height, step)[:, :row_bytes]
    typed = np.ascontiguousarray(rows).view(kind.newbyteorder(">" if message.is_bigendian else "<"))
    return typed.reshape(height, width, channels).astype(kind)


def _picture(data: bytes, topic: str, mode: str | None = None) -> NDArray[Any]:
    """Pixels of a PNG or JPEG, converted to a mode."""
    try:
        with Image.open(io.BytesIO(data)) as image:
            return np.array(image if mode is None else image.convert(mode))
    except DAMAGED_PICTURE as error:
        raise InputError(f"an image of {topic} is damaged: {unreadable(error)}") from error
