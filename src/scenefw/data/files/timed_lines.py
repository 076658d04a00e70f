"""Lists of files and poses by time, as the TUM RGB-D benchmark has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError
from scenefw.data.files.poses import read_numbers

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from scenefw.data.files.poses import PoseReader


def timed_lines(path: Path) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Times and the words after them, in the order of time."""
    lines = read_numbers(path)
    try:
        times = np.array([float(line[0]) for line in lines])
    except ValueError as error:
        raise InputError(
            f"{path} has a line without a timestamp: {error}; expected 'time ...'"
        ) from error
    if not lines or min(len(line) for line in lines) < 2:
        raise InputError(
            f"{path} is empty or has a line with only a timestamp; expected 'time file'"
        )
    order = np.argsort(times, kind="stable")
    return times[order], [lines[i][1:] for i in order]


def timed_poses(
    path: Path, reader: PoseReader
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Times and poses, without those that aren't finite."""
    times, lines = timed_lines(path)
    poses = [
        reader.read(words, f"time {time:.6f}", f"time {time} of {path}")
        for time, words in zip(times, lines, strict=True)
    ]
    finite = [number for number, pose in enumerate(poses) if pose is not None]
    return times[finite], [pose for pose in poses if pose is not None]


def nearest_times(
    times: NDArray[np.float64], candidates: NDArray[np.float64], max_delay: float
) -> NDArray[np.int64]:
    """Index of the nearest other time, -1 where none is within `max_delay` seconds."""
    after = np.clip(np.searchsorted(candidates, times), 1, max(len(candidates) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(candidates) - 1)
    closer = np.abs(candidates[after] - times) < np.abs(candidates[before] - times)
    nearest = np.where(closer, after, before)
    return np.where(np.abs(candidates[nearest] - times) <= max_delay, nearest, -1)
