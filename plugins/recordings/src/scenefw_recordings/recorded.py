"""Images of a recording or a camera as a folder that all other runs read."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from scenefw.core.errors import StorageError
from scenefw.core.files import require_writable
from scenefw.core.folders import replacing_folder

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from scenefw_recordings.bags import RecordedFrame

_MOST = np.iinfo(np.uint16).max


def write_recording(
    frames: Iterable[RecordedFrame], output: Path, limit: int | None
) -> dict[str, float]:
    """Writes `recording/` into a folder; returns the number of images, and of those with colour.

    It holds `depth/000000.png` (16 bits, mm), `rgb/000000.png` where colour is aligned with depth,
    `intrinsics.json` and `times.txt`, the seconds of each image. It appears when all is written.

    Args:
        frames: the images.
        output: the run's folder.
        limit: how many there are at most, if that is known.

    Raises:
        StorageError: the folder can't be written.
    """
    require_writable(output)
    target = output / "recording"
    coloured, times = 0, []
    notes: dict[str, None] = {}
    columns = (SpinnerColumn(), TextColumn("{task.completed:.0f} images"), TimeElapsedColumn())
    with Progress(*columns) as progress, replacing_folder(target) as folder:
        bar = progress.add_task("images", total=limit)
        for number, frame in enumerate(frames):
            _write(folder, number, frame)
            coloured += frame.colour is not None
            notes.update(dict.fromkeys(frame.notes))
            times.append(f"{frame.seconds:.6f}")
            progress.update(bar, advance=1)
        (folder / "times.txt").write_text("\n".join(times) + "\n", encoding="utf-8")
    for note in notes:
        print(note, file=sys.stderr)
    print(target)
    return {"images": float(len(times)), "coloured": float(coloured)}


def _write(folder: Path, number: int, frame: RecordedFrame) -> None:
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
