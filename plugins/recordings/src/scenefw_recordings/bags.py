"""Depth and colour images of ROS 1 and ROS 2 bags, and of RealSense recordings, which are bags."""

from __future__ import annotations

from collections import deque
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice, repeat
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import EmptyImageError, InputError, MissingDependencyError
from scenefw.core.files import unreadable
from scenefw.data.files.image_checks import Stored, check_depth, metres
from scenefw.data.files.layouts import MILLIMETRES
from scenefw.data.files.lens import undistorted
from scenefw.data.files.timed_lines import nearest_times
from scenefw_recordings.camera_info import recorded_calibration
from scenefw_recordings.image_messages import colour_of, depth_of
from scenefw_recordings.topics import topics_of

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.data.files.intrinsics import Calibration
    from scenefw_recordings.topics import Topics


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


class Bag:
    """A recording: a `.bag` (ROS 1, RealSense), a `.db3` or `.mcap`, or a folder of ROS 2.

    Args:
        path: of it.
        depth: topic of depth images; None: the one whose name says so, an aligned one first.
        colour: topic of colour images; None: one beside, if it is aligned; `none`: no colour.
        info: topic of the intrinsics of depth; None: beside the images.
        depth_scale: metres per unit of integer depth; None: as the bag says, else millimetres.
    """

    def __init__(
        self,
        path: Path,
        depth: str | None = None,
        colour: str | None = None,
        info: str | None = None,
        depth_scale: float | None = None,
    ) -> None:
        self.path, self.topic_names = path, (depth, colour, info)
        self.depth_scale = depth_scale

    def frames(self, stride: int = 1, max_frames: int | None = None) -> Iterator[RecordedFrame]:
        """Every n-th depth image, with the colour nearest in time.

        Args:
            stride: how many to go on.
            max_frames: images at most; None means all.

        Raises:
            InputError: the bag is damaged, or has no such topics, no known encoding, intrinsics of
                another image, or depth in another unit.
            MissingDependencyError: rosbags isn't installed.
        """
        with self._opened() as reader:
            kinds = {
                connection.topic: _kind(connection.msgtype) for connection in reader.connections
            }
            topics = topics_of(kinds, *self.topic_names)
            info, unit = self._constants(reader, topics)
            stop = None if max_frames is None else (max_frames - 1) * stride + 1
            chosen = slice(0, stop, stride)
            colours, notes = _colour_numbers(reader, topics, chosen)
            calibration = None
            for pair in islice(_pairs(reader, topics, colours), 0, stop, stride):
                depth = self._metres(pair.depth, topics.depth, unit)
                calibration = calibration or recorded_calibration(info, topics, *depth.shape)
                yield _recorded_frame(depth, pair, calibration, topics, notes)
            if calibration is None:
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

    def _constants(self, reader: Any, topics: Topics) -> tuple[Any, float]:
        """The message with the intrinsics, and metres per unit of integer depth."""
        info, unit = None, None
        for topic, _, message in _messages(reader, [topics.info, topics.unit]):
            if topic == topics.info and info is None:
                info = message
            elif topic == topics.unit and unit is None:
                unit = float(message.data)
            if info is not None and (unit is not None or topics.unit is None):
                break
        if info is None:
            raise InputError(f"{self.path} has no message of topic {topics.info}, the intrinsics")
        if self.depth_scale is None and unit is not None and not 0 < unit < np.inf:
            raise InputError(
                f"{topics.unit} says {unit:g} metres per unit of depth; give run.depth_scale, such "
                "as 0.001"
            )
        return info, MILLIMETRES if unit is None else unit

    def _metres(self, message: Any, topic: str, unit: float) -> NDArray[np.float32]:
        """Depth (H, W) m of a message, 0 where nothing is measured."""
        values = depth_of(message, topic)
        depth = metres(values, self.depth_scale, topic, unit)
        is_whole = values.dtype.kind in "ui"
        stored = Stored(self.depth_scale or unit, None) if is_whole else Stored()
        try:
            return check_depth(depth, topic, stored)
        except EmptyImageError:  # whoever writes it leaves it out
            return np.zeros_like(depth)


@dataclass(frozen=True, eq=False)
class _Pair:
    """Messages of depth and of its colour, if there is one."""

    seconds: float
    depth: Any
    colour: Any


def _pairs(reader: Any, topics: Topics, colours: Iterator[int]) -> Iterator[_Pair]:
    """All depth images with their colours, of which the numbers are given, -1 = none.

    A depth image waits while its colour comes after it.
    """
    waiting: deque[tuple[int, float, Any]] = deque()
    number, colour = -1, None
    for topic, seconds, message in _messages(reader, [topics.depth, topics.colour]):
        if topic == topics.colour:
            number, colour = number + 1, message
        else:
            waiting.append((next(colours), seconds, message))
        while waiting and waiting[0][0] <= number:
            match, time, depth = waiting.popleft()
            yield _Pair(time, depth, None if match < 0 else colour)


def _colour_numbers(
    reader: Any, topics: Topics, chosen: slice
) -> tuple[Iterator[int], tuple[str, ...]]:
    """Number of the colour nearest to each depth image, -1 = none is near; notes of the recording.

    Args:
        reader: of the bag.
        topics: of both.
        chosen: the depth images that are read.
    """
    if topics.colour is None:
        return repeat(-1), topics.notes
    times: dict[str, list[float]] = {topics.depth: [], topics.colour: []}
    for connection, time, _ in _raw_messages(reader, list(times)):
        times[connection.topic].append(time * 1e-9)
    depths, colours = (np.array(times[name]) for name in (topics.depth, topics.colour))
    if not len(colours):
        return repeat(-1), (*topics.notes, f"{topics.colour} has no image")
    max_delay = _max_delay(colours, depths)
    numbers = nearest_times(depths, colours, max_delay)
    misses = int((numbers[chosen] < 0).sum())
    note = (
        f"no colour for {misses} of {len(numbers[chosen])} depth images: {topics.colour} has none "
        f"within {max_delay:.3g} s of them"
    )
    return iter(numbers.tolist()), (*topics.notes, *([note] if misses else []))


def _max_delay(colours: NDArray[np.float64], depths: NDArray[np.float64]) -> float:
    """Most between a depth image and its colour (s): the median period of colour.

    Half of it is the most in a steady recording; the other half is for images late or lost: of 900
    images at 30 Hz whose times scatter by 5 ms, half a period leaves 9 % without colour, a whole
    one none. A single colour has no period: that of depth stands for it.
    """
    for times in (colours, depths):
        if len(times) > 1:
            return float(np.median(np.diff(times)))
    return np.inf


def _messages(reader: Any, topics: Sequence[str | None]) -> Iterator[tuple[str, float, Any]]:
    """Topic, seconds and message."""
    for connection, time, raw in _raw_messages(reader, topics):
        yield connection.topic, time * 1e-9, reader.deserialize(raw, connection.msgtype)


def _raw_messages(reader: Any, topics: Sequence[str | None]) -> Iterator[tuple[Any, int, bytes]]:
    connections = [connection for connection in reader.connections if connection.topic in topics]
    yield from reader.messages(connections=connections)


def _recorded_frame(
    depth: NDArray[np.float32],
    pair: _Pair,
    calibration: Calibration,
    topics: Topics,
    notes: tuple[str, ...],
) -> RecordedFrame:
    """A frame of a pinhole camera, with its colour if that can be read and is of its size."""
    colour, colour_notes = _colour(pair.colour, depth, topics)
    notes += colour_notes
    if calibration.lens is not None:
        depth, colour = undistorted(
            calibration.lens, calibration.matrix, [depth, colour], topics.depth
        )
        notes += (f"images are undistorted by the coefficients D of {topics.info}",)
    return RecordedFrame(depth, calibration.matrix, colour, pair.seconds, notes)


def _colour(
    message: Any, depth: NDArray[np.float32], topics: Topics
) -> tuple[NDArray[np.uint8] | None, tuple[str, ...]]:
    """Colour in the pixels of depth, or None and a line that says why it is left out."""
    if message is None:
        return None, ()
    try:
        colour = colour_of(message, str(topics.colour))
    except InputError as error:
        return None, (f"colour is left out: {error}",)
    if colour.shape[:2] == depth.shape:
        return colour, ()
    return None, (
        f"colour {topics.colour} is left out: it has {colour.shape[1]} x {colour.shape[0]} "
        f"pixels, depth {depth.shape[1]} x {depth.shape[0]}; record depth aligned to colour",
    )


def _kind(name: str) -> str:
    return name.rpartition("/")[2]
