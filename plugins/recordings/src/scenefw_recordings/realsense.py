"""Depth and aligned colour images of a RealSense camera, or of what one recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw.core.settings import COUNT, NOT_NEGATIVE
from scenefw_recordings.bags import RecordedFrame
from scenefw_recordings.image_messages import CHANNELS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from numpy.typing import NDArray

_NO_CAMERA = "no RealSense camera answers; plug one in, or give input=FILE that one recorded"
_PATIENCE = 5000  # ms for the next images


class RealSense:
    """A camera that is plugged in, or a file that librealsense recorded.

    Args:
        recording: `.bag` or `.db3`; None: the first camera that is plugged in.
        size: (width, height) of depth; None: what the camera does by itself.
        rate: images per second of a camera; None: what it does by itself.
        align: whose pixels depth and colour share: colour is moved to those of `depth`, or depth to
            those of `colour`; `none`: there is no colour.
        warm_up: images of a camera that are left out first, while it finds its exposure.

    Raises:
        ConfigError: a number is negative, or there is no such way to align.
    """

    def __init__(
        self,
        recording: Path | None = None,
        size: tuple[int, int] | None = None,
        rate: int | None = None,
        align: Literal["depth", "colour", "none"] = "depth",
        warm_up: int = 30,
    ) -> None:
        if align not in ("depth", "colour", "none"):
            raise ConfigError(f"run.align = {align}: expected depth, colour or none")
        NOT_NEGATIVE.require(warm_up=warm_up)
        COUNT.require(rate=rate, size=size)
        self.recording, self.size, self.rate = recording, size, rate
        self.align, self.warm_up = align, warm_up

    def frames(self, stride: int = 1, max_frames: int | None = None) -> Iterator[RecordedFrame]:
        """Every n-th pair of images; those of a camera go on until `max_frames`.

        Args:
            stride: how many to go on.
            max_frames: images at most; None means all.

        Raises:
            InputError: there is no camera, it sends nothing, or the file is no recording.
            MissingDependencyError: pyrealsense2 isn't installed.
        """
        library = require_realsense()
        pipeline, units = self._started(library)
        try:
            kind = {"depth": library.stream.depth, "colour": library.stream.color}.get(self.align)
            aligned = kind is not None and library.align(kind)
            skipped = 0 if self.recording else self.warm_up
            number = count = 0
            while count != max_frames:
                success, pair = pipeline.try_wait_for_frames(_PATIENCE)
                if not success:
                    break
                number += 1
                if number <= skipped or (number - 1 - skipped) % stride:
                    continue
                frame = _frame(aligned.process(pair) if aligned else pair, units, aligned)
                if frame is not None:
                    count += 1
                    yield frame
        finally:
            pipeline.stop()
        if not count or (max_frames is not None and not self.recording and count < max_frames):
            where = self.recording or "the camera"
            raise InputError(
                f"{where} sent {count} pairs of depth and colour in time; is depth recorded, and "
                "the camera at a USB 3 port?"
            )

    def _started(self, library: Any) -> tuple[Any, float]:
        """A running pipeline, and the metres of its unit of depth."""
        settings, pipeline = library.config(), library.pipeline()
        if self.recording is None and not len(library.context().query_devices()):
            raise InputError(_NO_CAMERA)  # a pipeline would wait for one
        try:
            if self.recording is not None:
                settings.enable_device_from_file(str(self.recording), repeat_playback=False)
            else:
                width, height = self.size or (0, 0)  # 0: any
                depth = (library.stream.depth, width, height, library.format.z16)
                settings.enable_stream(*depth, self.rate or 0)
                if self.align != "none":
                    settings.enable_stream(
                        library.stream.color, 0, 0, library.format.rgb8, self.rate or 0
                    )
            device = pipeline.start(settings).get_device()
            if self.recording is not None:
                device.as_playback().set_real_time(False)  # drops no image
            return pipeline, float(device.first_depth_sensor().get_depth_scale())
        except RuntimeError as error:
            if self.recording is not None:
                raise InputError(f"cannot play {self.recording}: {error}") from error
            raise InputError(f"{_NO_CAMERA} ({error})") from error


def require_realsense() -> Any:
    """The library.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        import pyrealsense2
    except ImportError as error:
        raise MissingDependencyError(
            "run=capture needs pyrealsense2: pip install 'scenefw[realsense]'"
        ) from error
    return pyrealsense2


def _frame(pair: Any, unit: float, aligned: Any) -> RecordedFrame | None:
    """Depth in metres, with colour if that was asked for; None if one of them is missing."""
    depth, colour = pair.get_depth_frame(), pair.get_color_frame() if aligned else None
    if not depth or (aligned and not colour):
        return None
    lens = depth.get_profile().as_video_stream_profile().get_intrinsics()
    matrix = np.array([[lens.fx, 0, lens.ppx], [0, lens.fy, lens.ppy], [0, 0, 1]])
    metres = np.asanyarray(depth.get_data()).astype(np.float32) * np.float32(unit)
    return RecordedFrame(
        metres, matrix, _pixels(colour) if aligned else None, depth.get_timestamp() / 1000
    )


def _pixels(colour: Any) -> NDArray[np.uint8]:
    encoding = str(colour.get_profile().format()).rpartition(".")[2]
    if encoding not in CHANNELS:
        raise InputError(
            f"colour was recorded as {encoding}; expected {', '.join(CHANNELS)}, or give "
            "run.align=none"
        )
    return np.ascontiguousarray(np.asanyarray(colour.get_data())[..., CHANNELS[encoding]])
