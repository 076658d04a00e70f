"""Images of a RealSense camera as a folder that all other runs read."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from scenefw.core.errors import ConfigError, InputError
from scenefw_recordings.realsense import RealSense, require_realsense
from scenefw_recordings.recorded import write_recording


class Capture:
    """Writes images of a RealSense camera, or of its recording, as an RGB-D folder (`run=capture`).

    `recorded.write_recording` says what is in it. Depth and colour share their pixels, which those
    of a recording alone don't.

    Args:
        input: `.bag` or `.db3` that librealsense recorded; None: a camera that is plugged in.
        output: the run's folder.
        most: images at most; None means all of a recording.
        every: one image of so many.
        size: (width, height) of a camera's depth; None: what it does by itself.
        rate: images per second of a camera; None: what it does by itself.
        align: `depth`, `colour` or `none`, as of `RealSense`.
        warm_up: images of a camera that are left out first, while it finds its exposure.

    Raises:
        ConfigError: a number is out of range.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as on the command line
        output: str | Path,
        most: int | None = 30,
        every: int = 1,
        size: tuple[int, int] | None = None,
        rate: int | None = None,
        align: Literal["depth", "colour", "none"] = "depth",
        warm_up: int = 30,
    ) -> None:
        if every < 1 or (most is not None and most < 1):
            raise ConfigError(f"run.every is {every} and run.most {most}; expected 1 or more")
        if input is None and most is None:
            raise ConfigError("a camera has no last image; give run.most=IMAGES")
        self.input = None if input is None else Path(input)
        pair = None if size is None else (int(size[0]), int(size[1]))
        self.camera = RealSense(self.input, pair, rate, align, warm_up)
        self.output, self.most, self.every = Path(output), most, every

    def run(self) -> dict[str, float]:
        """Writes the folder; returns the number of images, and of those with colour.

        Raises:
            InputError: there is no camera, or the recording is missing or damaged.
            MissingDependencyError: pyrealsense2 isn't installed.
            StorageError: the folder can't be written.
        """
        require_realsense()
        if self.input is not None and not self.input.is_file():
            raise InputError(f"no file {self.input}; give input=FILE.bag or .db3, or no input")
        return write_recording(self.camera.frames(self.every, self.most), self.output, self.most)
