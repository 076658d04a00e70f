"""Frames of a recording placed in the frame of a map that starts, or of one that is gone on with.

The table is found in one frame alone and kept with the map: another frame sees another part of the
table, so that the middle of what it sees is another.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.types import Frame
from scenefw.data.recordings import Recording
from scenefw.data.sequences import transformed
from scenefw.perception.table_frame import TableFrame


class Tracking(Protocol):
    """Finds camera poses of frames without any."""

    def track(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames with poses relative to the first camera."""


@dataclass(frozen=True)
class Placed:
    """Frames that stand in a map's frame.

    Args:
        recording: where they come from; its frames are those before these.
        frames: to be fused.
        note: what was done, in words; empty if nothing was.
    """

    recording: Recording
    frames: Iterator[Frame]
    note: str = ""


class Placement:
    """Places the frames of a recording.

    Args:
        table: finds the table.
        odometry: finds poses; None = the frames have some.
    """

    def __init__(self, table: TableFrame, odometry: Tracking | None = None) -> None:
        self.table = table
        self.odometry = odometry

    def begin(self, frames: Iterable[Frame]) -> Placed:
        """Frames of a new map, whose frame is that of the table in the first of them.

        Raises:
            InputError: there is no frame, or no table and no pose.
        """
        frames = iter(frames) if self.odometry is None else self.odometry.track(frames)
        first = next(frames, None)
        if first is None:
            raise InputError("no frame of the recording has a measurement; record it again")
        posed = self.odometry is None
        alignment = self.table.alignment(first, posed=posed)
        T = alignment.T_table_world  # noqa: N806
        moved = transformed(itertools.chain([first], frames), T)
        return Placed(Recording(T if posed else None), moved, alignment.note)

    def go_on(self, frames: Iterable[Frame], before: Recording, joint: Frame | None) -> Placed:
        """Frames that a map is gone on with.

        Args:
            frames: those to come.
            before: the recording of the map so far.
            joint: the frame before these, from which they are tracked; None = there is none.

        Raises:
            InputError: nothing says where the frames lie in the map.
        """
        if self.odometry is not None:
            if joint is None or joint.name not in before.names:
                raise InputError(
                    f"the map was made of {len(before.names)} frames; a recording without poses "
                    "goes on with the frame after the last of them: give run.start=NUMBER"
                )
            tracked = self.odometry.track(itertools.chain([joint], frames))
            next(tracked)
            start = before.poses[before.names.index(joint.name)]
            return Placed(before, transformed(tracked, start))
        if before.T_map_world is not None:
            return Placed(before, before.in_map(frames))
        begun = self.begin(frames)
        T = begun.recording.T_map_world  # noqa: N806
        if T is None or not np.array_equal(T, np.eye(4)):
            raise InputError(
                "the saved map does not say how the world of the poses lies to it, and that world "
                "is not the table's; fuse the whole recording again"
            )
        return Placed(before if before.names else begun.recording, begun.frames, begun.note)
