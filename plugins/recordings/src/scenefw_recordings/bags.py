"""Depth and colour images of ROS 1 and ROS 2 bags, and of RealSense recordings, which are bags."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import InputError, MissingDependencyError
from scenefw.core.files import unreadable
from scenefw.data.files.lens import Lens, lens_of, undistorted
from scenefw_recordings.image_messages import MILLIMETRES, colour_of, depth_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

_IMAGE, _COMPRESSED, _INFO = "Image", "CompressedImage", "CameraInfo"
_REGISTERED_DEPTH = ("aligned", "registered", "depth_to_rgb", "depth_to_color", "depth_to_colour")
"""Words in topics of depth in the pixels of colour: librealsense, OpenNI, ZED, Azure Kinect."""
_REGISTERED_COLOUR = ("rgb_to_depth", "color_to_depth", "colour_to_depth")
"""Words in topics of colour in the pixels of depth."""
_COLOUR = ("color", "colour", "rgb")


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A depth image of a recording or of a camera.

    Args:
        depth: (H, W) m, 0 = none.
        matrix: (3, 3) intrinsics.
        colour: (H, W, 3) uint8 of the same size, nearest in time; None if there is none.
        seconds: when it was recorded.
        notes: what the recording left open, a line each.
    """

    depth: NDArray[np.float32]
    matrix: NDArray[np.float64]
    colour: NDArray[np.uint8] | None
    seconds: float
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Topics:
    """Names of what is read.

    Args:
        depth: images of depth.
        info: their intrinsics.
        colour: images from the same place and of the same size; None: there are none.
        unit: metres per unit of integer depth, as one message; None: millimetres.
        notes: why colour is left out, a line.
    """

    depth: str
    info: str
    colour: str | None = None
    unit: str | None = None
    notes: tuple[str, ...] = ()


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
            camera, unit = self._constants(reader, topics)
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
                yield _recorded_frame(depth, colour, camera, topics, time * 1e-9)
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

    def _constants(self, reader: Any, topics: Topics) -> tuple[_CameraInfo, float]:
        """Intrinsics with the lens, and metres per unit of integer depth."""
        camera, unit = None, None
        for topic, _, message in self._messages(reader, [topics.info, topics.unit]):
            if topic == topics.info and camera is None:
                camera = _camera_info(message, topics)
            elif topic == topics.unit and unit is None:
                unit = float(message.data)
            if camera is not None and (unit is not None or topics.unit is None):
                break
        if camera is None:
            raise InputError(f"{self.path} has no message of topic {topics.info}, the intrinsics")
        return camera, unit or MILLIMETRES


@dataclass(frozen=True, eq=False)
class _CameraInfo:
    matrix: NDArray[np.float64]
    lens: Lens | None


def _camera_info(message: Any, topics: Topics) -> _CameraInfo:
    """Of `sensor_msgs/CameraInfo`: P of rectified images, else K with the distortion D."""
    fields = {name.lower(): value for name, value in vars(message).items()}  # K in ROS 1, k in 2
    projection = np.array(fields["p"], np.float64).reshape(3, 4)[:, :3]
    if "rect" in topics.depth and projection[0, 0] > 0:
        return _CameraInfo(projection, None)
    matrix = np.array(fields["k"], np.float64).reshape(3, 3)
    return _CameraInfo(matrix, lens_of(fields["distortion_model"], fields["d"], topics.info))


def _recorded_frame(
    depth: NDArray[np.float32],
    colour: NDArray[np.uint8] | None,
    camera: _CameraInfo,
    topics: Topics,
    seconds: float,
) -> RecordedFrame:
    """A frame of a pinhole camera, with the last colour before it if that is of its size."""
    notes = list(topics.notes)
    if colour is not None and colour.shape[:2] != depth.shape:
        notes.append(
            f"colour {topics.colour} is left out: it has {colour.shape[1]} x {colour.shape[0]} "
            f"pixels, depth {depth.shape[1]} x {depth.shape[0]}; record depth aligned to colour"
        )
        colour = None
    if camera.lens is not None:
        images: list[NDArray[Any]] = [depth] if colour is None else [depth, colour]
        depth, *colour_images = undistorted(camera.lens, camera.matrix, images, topics.depth)
        colour = colour_images[0] if colour_images else None
        notes.append(f"images are undistorted by the coefficients D of {topics.info}")
    return RecordedFrame(depth, camera.matrix, colour, seconds, tuple(notes))


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
    depth = depth or _depth_topic(pictures, kinds)
    if info is None:
        places = [topic for topic, kind in kinds.items() if kind == _INFO]
        neighbours = sorted(places, key=lambda topic: -_shared(topic, depth))
        if not neighbours or _shared(neighbours[0], depth) < 2:  # "" and one more
            raise InputError(
                f"no topic beside {depth} has intrinsics; give run.info=TOPIC of {_listed(kinds)}"
            )
        info = neighbours[0]
    notes: tuple[str, ...] = ()
    if colour is None:
        colour, notes = _colour_topic(pictures, kinds, depth)
    units = [name for name in kinds if name.endswith("/option/Depth_Units/value")]
    neighbours = [name for name in units if _shared(name, depth) > 2]  # of the same sensor
    return Topics(depth, info, colour, neighbours[0] if neighbours else None, notes)


def _depth_topic(pictures: Sequence[str], kinds: dict[str, str]) -> str:
    candidates = [
        name for name in pictures if "depth" in name.lower() and not _has(name, _REGISTERED_COLOUR)
    ]
    if not candidates:
        raise InputError(
            f"no topic with images is named depth; give run.depth=TOPIC of {_listed(kinds)}"
        )
    return min(
        candidates,
        key=lambda name: (
            not _has(name, _REGISTERED_DEPTH),
            kinds[name] != _IMAGE,
            "compressedDepth" not in name,
            len(name),
        ),
    )


def _colour_topic(
    pictures: Sequence[str], kinds: dict[str, str], depth: str
) -> tuple[str | None, tuple[str, ...]]:
    """Colour in the pixels of depth, or None and a line that says why it is left out."""
    colours = [name for name in pictures if _has(name, _COLOUR) and name != depth]
    moved = [name for name in colours if _has(name, _REGISTERED_COLOUR)]
    colour_topics = [name for name in colours if "depth" not in name.lower()]
    candidates = colour_topics if _has(depth, _REGISTERED_DEPTH) else moved
    if not candidates:
        if not colour_topics:
            return None, ()
        return None, (
            f"colour {min(colour_topics, key=len)} is left out, as nothing says that it is "
            f"aligned with {depth}; record depth aligned to colour, or give run.colour=TOPIC if it "
            "is",
        )
    is_raw = "image_raw" in depth and "rect" not in depth
    return min(
        candidates,
        key=lambda name: (("rect" in name) == is_raw, kinds[name] != _IMAGE, len(name)),
    ), ()


def _has(name: str, words: Sequence[str]) -> bool:
    return any(word in name.lower() for word in words)


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
