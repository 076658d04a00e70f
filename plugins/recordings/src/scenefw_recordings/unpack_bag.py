"""Images of a bag as a folder that all other runs read."""

from __future__ import annotations

from pathlib import Path

from scenefw.core.errors import ConfigError
from scenefw.core.settings import FINITE, POSITIVE
from scenefw_recordings.bags import Bag
from scenefw_recordings.recorded import write_recording


class UnpackBag:
    """Writes images of a recording as an RGB-D folder (`run=unpack_bag input=FILE.bag`).

    `recorded.write_recording` says what is in it.

    Args:
        input: a bag of ROS 1, ROS 2 or RealSense.
        output: the run's folder.
        every: one image of so many.
        most: images at most; None means all.
        depth: topic of depth; None: the one whose name says so.
        colour: topic of colour that is aligned with depth; None: one beside aligned depth; `none`:
            no colour.
        info: topic of the intrinsics of depth; None: the one beside it.
        depth_scale: metres per unit of integer depth; None: as the bag says, else millimetres.

    Raises:
        ConfigError: no input, or a number out of range.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as on the command line
        output: str | Path,
        every: int = 1,
        most: int | None = None,
        depth: str | None = None,
        colour: str | None = None,
        info: str | None = None,
        depth_scale: float | None = None,
    ) -> None:
        if input is None:
            raise ConfigError("give input=PATH of a bag (.bag, .db3, .mcap, or a folder of ROS 2)")
        if every < 1 or (most is not None and most < 1):
            raise ConfigError(f"run.every is {every} and run.most {most}; expected 1 or more")
        POSITIVE.require(depth_scale=depth_scale)
        FINITE.require(depth_scale=depth_scale)
        self.bag = Bag(Path(input), depth, colour, info, depth_scale)
        self.output, self.every, self.most = Path(output), every, most

    def run(self) -> dict[str, float]:
        """Writes the folder; returns the number of images, and of those with colour.

        Raises:
            InputError: the bag is missing, damaged, or has no depth that fits its intrinsics.
            StorageError: the folder can't be written.
        """
        return write_recording(self.bag.frames(self.every, self.most), self.output, self.most)
