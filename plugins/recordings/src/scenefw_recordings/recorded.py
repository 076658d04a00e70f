"""Images of a recording or a camera as a folder that all other runs read."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from scenefw.core.errors import InputError, StorageError
from scenefw.core.files import require_writable, write_text
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
    Images without a measurement are left out, and, as sequences have colour for all images or for
    none, those without colour if others have it.

    Args:
        frames: the images.
        output: the run's folder.
        limit: how many there are at most, if that is known.

    Raises:
        InputError: nothing is measured, or images are of several sizes.
        StorageError: the folder can't be written.
    """
    require_writable(output)
    target = output / "recording"
    times: dict[int, float] = {}
    coloured: set[int] = set()
    notes: dict[str, None] = {}
    first, count = None, 0
    columns = (SpinnerColumn(), TextColumn("{task.completed:.0f} images"), TimeElapsedColumn())
    with Progress(*columns) as progress, replacing_folder(target) as folder:
        bar = progress.add_task("images", total=limit)
        for number, frame in enumerate(frames):
            count = number + 1
            notes.update(dict.fromkeys(frame.notes))
            progress.update(bar, advance=1)
            if not frame.depth.any():
                continue
            first = first or frame
            _require_same_size(frame, first, number)
            _write(folder, number, frame)
            times[number] = frame.seconds
            if frame.colour is not None:
                coloured.add(number)
        if first is None:
            raise InputError(f"none of {count} depth images has a measurement; record them again")
        if count > len(times):
            left_out = count - len(times)
            notes[f"{left_out} of {count} depth images are left out: nothing is measured"] = None
        notes.update(dict.fromkeys(_leave_out_plain(folder, times, coloured)))
        lines = [f"{seconds:.6f}" for seconds in times.values()]
        write_text(folder / "times.txt", "\n".join(lines) + "\n")
        matrix = json.dumps({"K": first.matrix.tolist()})
        write_text(folder / "intrinsics.json", matrix + "\n")
    for note in notes:
        print(note, file=sys.stderr)
    print(target)
    return {"images": float(len(times)), "coloured": float(len(coloured))}


def _require_same_size(frame: RecordedFrame, first: RecordedFrame, number: int) -> None:
    (height, width), (rows, columns) = frame.depth.shape, first.depth.shape
    if (height, width) != (rows, columns):
        raise InputError(
            f"depth image {number + 1} has {width} x {height} pixels, the first one {columns} x "
            f"{rows}; run.most={number} takes those before it"
        )


def _leave_out_plain(folder: Path, times: dict[int, float], coloured: set[int]) -> list[str]:
    """Takes images without colour out if others have it; returns a line that says so."""
    plain = times.keys() - coloured
    if not plain or not coloured:
        return []
    note = (
        f"{len(plain)} of {len(times)} depth images are left out, as only the others have colour; "
        "run.colour=none keeps all of them, without colour"
    )
    for number in plain:
        _file(folder, "depth", number).unlink()
        del times[number]
    return [note]


def _file(folder: Path, kind: str, number: int) -> Path:
    return folder / kind / f"{number:06d}.png"


def _write(folder: Path, number: int, frame: RecordedFrame) -> None:
    millimetres = np.rint(1000 * frame.depth.astype(np.float64))
    units = np.where(millimetres <= _MOST, millimetres, 0).astype(np.uint16)
    pictures = {"depth": units, "rgb": frame.colour}
    try:
        for kind, pixels in pictures.items():
            if pixels is not None:
                (folder / kind).mkdir(exist_ok=True)
                Image.fromarray(pixels).save(_file(folder, kind, number))
    except OSError as error:
        raise StorageError(
            f"cannot write {folder}: {error.strerror or error}; choose a writable paths.output"
        ) from error
