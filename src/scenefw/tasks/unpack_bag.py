"""Images of a bag as a folder that all other runs read."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.files import replacing_folder, require_writable
from scenefw.data.bags import Bag

if TYPE_CHECKING:
    from scenefw.data.bags import BagFrame

_MOST = np.iinfo(np.uint16).max


class UnpackBag:
    """Writes images of a recording as an RGB-D folder (`run=unpack_bag input=FILE.bag`).

    `recording/` holds `depth/000000.png` (16 bits, mm), `rgb/000000.png` where colour is aligned
    with depth, `intrinsics.json` and `times.txt`, the seconds of each image. It appears when all is
    written.

    Args:
        input: a bag of ROS 1, ROS 2 or RealSense.
        output: the run's folder.
        every: one image of so many.
        most: images at most; None means all.
        depth: topic of depth; None: the one whose name says so.
        colour: topic of colour that is aligned with depth; None: one beside aligned depth.
        info: topic of the intrinsics of depth; None: the one beside it.

    Raises:
        ConfigError: no input, or a number below one.
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
    ) -> None:
        if input is None:
            raise ConfigError("give input=PATH of a bag (.bag, .db3, .mcap, or a folder of ROS 2)")
        if every < 1 or (most is not None and most < 1):
            raise ConfigError(f"run.every is {every} and run.most {most}; expected 1 or more")
        self.bag = Bag(Path(input), depth, colour, info)
        self.output, self.every, self.most = Path(output), every, most

    def run(self) -> dict[str, float]:
        """Writes the folder; returns the number of images, and of those with colour.

        Raises:
            InputError: the bag is missing, damaged, or has no depth.
            StorageError: the folder can't be written.
        """
        require_writable(self.output)
        target = self.output / "recording"
        coloured, times = 0, []
        columns = (SpinnerColumn(), TextColumn("{task.completed:.0f} images"), TimeElapsedColumn())
        with Progress(*columns) as progress, replacing_folder(target) as folder:
            bar = progress.add_task("images", total=self.most)
            for number, frame in enumerate(self.bag.frames(self.every, self.most)):
                _write(folder, number, frame)
                coloured += frame.colour is not None
                times.append(f"{frame.seconds:.6f}")
                progress.update(bar, advance=1)
            (folder / "times.txt").write_text("\n".join(times) + "\n", encoding="utf-8")
        print(target)
        return {"images": float(len(times)), "coloured": float(coloured)}


def _write(folder: Path, number: int, frame: BagFrame) -> None:
    millimetres = np.rint(1000 * frame.depth.astype(np.float64))
    units = np.where(millimetres <= _MOST, millimetres, 0).astype(np.uint16)
    pictures = {"depth": units, "rgb": frame.colour}
    try:
        for kind, pixels in pictures.items():
            if pixels is not None:
                (folder / kind).mkdir(exist_ok=True)
                Image.fromarray(pixels).save(folder / kind / f"{number:06d}.png")
        if number == 0:
            matrix = json.dumps({"K": frame.matrix.tolist()})
            (folder / "intrinsics.json").write_text(matrix + "\n", encoding="utf-8")
    except OSError as error:
        raise StorageError(
            f"cannot write {folder}: {error.strerror or error}; choose a writable paths.output"
        ) from error
