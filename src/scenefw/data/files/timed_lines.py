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
    if not np.isfinite(times).all():
        raise InputError(f"{path} has a time that is {times[~np.isfinite(times)][0]}; give seconds")
    order = np.argsort(times, kind="stable")
    repeated = np.flatnonzero(np.diff(times[order]) == 0)
    if repeated.size:
        raise InputError(
            f"{path} has two lines of the time {times[order][repeated[0]]:.6f}; keep one"
        )
    return times[order], [lines[i][1:] for i in order]


def unmatched_note(
    name: str,
    times: NDArray[np.float64],
    candidates: NDArray[np.float64],
    matches: NDArray[np.int64],
) -> tuple[str, ...]:
    """A line that says which images have no partner near enough; none if all have one.

    Args:
        name: of what they lack.
        times: of the images (s).
        candidates: times of the partners (s).
        matches: as of `nearest_times`.
    """
    lonely = times[matches < 0]
    if not len(lonely) or not len(candidates):
        return ()
    delay = np.abs(candidates - lonely[0]).min()
    return (
        f"{len(lonely)} of {len(times)} depth images have no {name}; the nearest to that of "
        f"{lonely[0]:.6f} is {delay:.3g} s away",
    )


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
