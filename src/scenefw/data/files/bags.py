"""Depth and colour images of ROS 1 and ROS 2 bags, and of RealSense recordings, which are bags."""

from __future__ import annotations

import io
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.core.files import unreadable
from scenefw.data.files.pictures import DAMAGED_PICTURE

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

_DEPTH = {"16UC1": np.uint16, "mono16": np.uint16, "32FC1": np.float32}
CHANNELS = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2], "bgra8": [2, 1, 0]}
"""Places of red, green and blue in pixels, by encoding."""
_IMAGE, _COMPRESSED, _INFO = "Image", "CompressedImage", "CameraInfo"
_HEADER = 12  # bytes before the PNG of compressed depth
_MILLIMETRES = 0.001


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A depth image of a recording or of a camera.

    Args:
        depth: (H, W) m, 0 = none.
        matrix: (3, 3) intrinsics.
        colour: (H, W, 3) uint8 of the same size, nearest in time; None if there is none.
        seconds: when it was recorded.
    """

    depth: NDArray[np.float32]
    matrix: NDArray[np.float64]
    colour: NDArray[np.uint8] | None
    seconds: float


@dataclass(frozen=True)
class Topics:
    """Names of what is read.

    Args:
        depth: images of depth.
        info: their intrinsics.
        colour: images from the same place and of the same size; None: there are none.
        unit: metres per unit of integer depth, as one message; None: millimetres.
    """

    depth: str
    info: str
    colour: str | None = None
    unit: str | None = None


class Bag:
    """A recording: a `.bag` (ROS 1, RealSense), a `.db3` or `.mcap`, or a folder of ROS 2.

    Args:
        path: of it.
        depth: topic of depth images; None: the one whose name says so, an aligned one first.
        colour: topic of colour images; None: one beside, if it is aligned.
        info: topic of the intrinsics of depth; None: beside the images.
    """

    def __init__(
        self,
        path: Path,
        depth: str | None = None,
        colour: str | None = None,
        info: str | None = None,
    ) -> None:
        self.path, self.topic_names = path, (depth, colour, info)

    def frames(self, stride: int = 1, max_frames: int | None = None) -> Iterator[RecordedFrame]:
        """Every n-th depth image.

        Args:
            stride: how many to go on.
            max_frames: images at most; None means all.

        Raises:
            InputError: the bag is damaged, or has no such topics or no known encoding.
            MissingDependencyError: rosbags isn't installed.
        """
        with self._opened() as reader:
            kinds = {
                connection.topic: _kind(connection.msgtype) for connection in reader.connections
            }
            topics = topics_of(kinds, *self.topic_names)
            matrix, unit = self._constants(reader, topics)
            colour: NDArray[np.uint8] | None = None
            number = count = 0
            for topic, time, message in self._messages(reader, [topics.depth, topics.colour]):
                if topic == topics.colour:
                    colour = colour_of(message, topic)
                    continue
                number += 1
                if (number - 1) % stride:
                    continue
                depth = depth_of(message, topic, unit)
                fits = colour is not None and colour.shape[:2] == depth.shape
                yield RecordedFrame(depth, matrix, colour if fits else None, time * 1e-9)
                count += 1
                if count == max_frames:
                    return
            if not count:
                raise InputError(f"{self.path} has no image of topic {topics.depth}")

    @contextmanager
    def _opened(self) -> Iterator[Any]:
        try:
            from rosbags.highlevel import AnyReader, AnyReaderError
            from rosbags.rosbag1 import ReaderError as OfROS1
            from rosbags.rosbag2 import ReaderError as OfROS2
            from rosbags.typesys import Stores, get_typestore
        except ImportError as error:
            raise MissingDependencyError("bags need rosbags: pip install 'scenefw[ros]'") from error
        if not self.path.exists():
            raise InputError(f"no file or folder {self.path}; give input=PATH of a bag")
        try:
            types = get_typestore(Stores.ROS2_HUMBLE)
            with AnyReader([self.path], default_typestore=types) as reader:
                yield reader
        except (AnyReaderError, OfROS1, OfROS2, OSError, ValueError) as error:
            reason = unreadable(error)
            raise InputError(f"cannot read {self.path}: {reason}; is it a bag?") from error

    def _messages(
        self, reader: Any, topics: Sequence[str | None]
    ) -> Iterator[tuple[str, int, Any]]:
        connections = [
            connection for connection in reader.connections if connection.topic in topics
        ]
        for connection, time, raw in reader.messages(connections=connections):
            yield connection.topic, time, reader.deserialize(raw, connection.msgtype)

    def _constants(self, reader: Any, topics: Topics) -> tuple[NDArray[np.float64], float]:
        """Intrinsics, and metres per unit of integer depth."""
        matrix, unit = None, None
        for topic, _, message in self._messages(reader, [topics.info, topics.unit]):
            if topic == topics.info and matrix is None:
                fields = {name.lower(): value for name, value in vars(message).items()}
                matrix = np.array(fields["k"], np.float64).reshape(3, 3)  # K in ROS 1, k in ROS 2
            elif topic == topics.unit and unit is None:
                unit = float(message.data)
            if matrix is not None and (unit is not None or topics.unit is None):
                break
        if matrix is None:
            raise InputError(f"{self.path} has no message of topic {topics.info}, the intrinsics")
        return matrix, unit or _MILLIMETRES


def topics_of(
    kinds: dict[str, str], depth: str | None, colour: str | None, info: str | None
) -> Topics:
    """What to read of a bag.

    Args:
        kinds: last word of the type of each topic's messages, by topic.
        depth: the topic of depth, if it is known; likewise the following.
        colour: of colour.
        info: of the intrinsics of depth.

    Raises:
        InputError: there is no such topic, or none that could be meant.
    """
    for name in (depth, colour, info):
        if name is not None and name not in kinds:
            raise InputError(f"there is no topic {name}; the bag has {_listed(kinds)}")
    pictures = [name for name, kind in sorted(kinds.items()) if kind in (_IMAGE, _COMPRESSED)]
    if depth is None:
        candidates = [name for name in pictures if "depth" in name.lower()]
        candidates.sort(key=lambda name: ("aligned" not in name, kinds[name] != _IMAGE, len(name)))
        if not candidates:
            raise InputError(
                f"no topic with images is named depth; give run.depth=TOPIC of {_listed(kinds)}"
            )
        depth = candidates[0]
    if info is None:
        places = [topic for topic, kind in kinds.items() if kind == _INFO]
        neighbours = sorted(places, key=lambda topic: -_shared(topic, depth))
        if not neighbours or _shared(neighbours[0], depth) < 2:  # "" and one more
            raise InputError(
                f"no topic beside {depth} has intrinsics; give run.info=TOPIC of {_listed(kinds)}"
            )
        info = neighbours[0]
    if colour is None and "aligned" in depth:
        words = ("color", "colour", "rgb")
        candidates = [
            n for n in pictures if any(w in n.lower() for w in words) and "depth" not in n
        ]
        candidates.sort(key=lambda name: (kinds[name] != _IMAGE, len(name)))
        colour = candidates[0] if candidates else None
    units = [name for name in kinds if name.endswith("/option/Depth_Units/value")]
    neighbours = [name for name in units if _shared(name, depth) > 2]  # of the same sensor
    return Topics(depth, info, colour, neighbours[0] if neighbours else None)


def depth_of(message: Any, topic: str, unit: float = _MILLIMETRES) -> NDArray[np.float32]:
    """Depth (H, W) m of a message with an image, raw or as a PNG; 0 = none.

    Args:
        message: `sensor_msgs/Image` or `CompressedImage`.
        topic: for messages.
        unit: metres per unit of whole numbers.

    Raises:
        InputError: an encoding that isn't depth.
    """
    if _kind(message.__msgtype__) == _COMPRESSED:
        if "16UC1" not in message.format or "png" not in message.format:
            raise InputError(
                f"{topic} is compressed as '{message.format}'; expected 16UC1 as PNG, or raw images"
            )
        values = _decoded(bytes(message.data), topic, _HEADER)
        return (values.astype(np.float64) * unit).astype(np.float32)
    kind = _DEPTH.get(message.encoding)
    if kind is None:
        raise InputError(
            f"{topic} is encoded as {message.encoding}; expected one of {', '.join(_DEPTH)}"
        )
    values = _rows(message, np.dtype(kind), 1, topic)[..., 0]
    if kind is np.float32:
        return np.where(np.isfinite(values) & (values > 0), values, 0).astype(np.float32)
    return (values.astype(np.float64) * unit).astype(np.float32)


def colour_of(message: Any, topic: str) -> NDArray[np.uint8]:
    """Colours (H, W, 3) of a message with an image, raw or compressed.

    Raises:
        InputError: an unknown encoding.
    """
    if _kind(message.__msgtype__) == _COMPRESSED:
        return _decoded(bytes(message.data), topic).astype(np.uint8)
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


def _decoded(data: bytes, topic: str, header: int = 0) -> NDArray[Any]:
    try:
        with Image.open(io.BytesIO(data[header:])) as image:
            return np.array(image if header else image.convert("RGB"))
    except DAMAGED_PICTURE as error:
        raise InputError(f"an image of {topic} is damaged: {unreadable(error)}") from error


def _kind(name: str) -> str:
    return name.rpartition("/")[2]


def _shared(first: str, second: str) -> int:
    """How many words two topics begin with alike."""
    count = 0
    for a, b in zip(first.split("/"), second.split("/"), strict=False):
        if a != b:
            break
        count += 1
    return count


def _listed(kinds: dict[str, str]) -> str:
    useful = (_IMAGE, _COMPRESSED, _INFO)
    names = [f"{name} ({kind})" for name, kind in sorted(kinds.items()) if kind in useful]
    return ", ".join(names) or "no images"
