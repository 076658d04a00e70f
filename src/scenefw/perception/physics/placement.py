"""Places frames of a recording in the coordinates of a new or saved map.

The table is found once and kept with the map, since each frame sees another part of the table and
so another middle of it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.labelling_protocols import Odometry
from scenefw.core.types import Frame
from scenefw.data.files.recordings import Recording
from scenefw.data.files.sequences import transformed
from scenefw.perception.observation.table_frame import TableFrame


@dataclass(frozen=True)
class Placed:
    """Frames with poses in map coordinates.

    Args:
        recording: of the frames before these.
        frames: to be fused.
        note: what was done to place them, in words; empty if nothing was.
    """

    recording: Recording
    frames: Iterator[Frame]
    note: str = ""


class Placement:
    """Places the frames of a recording.

    Args:
        table: finds the table.
        odometry: estimates poses; None = the frames have them.
    """

    def __init__(self, table: TableFrame, odometry: Odometry | None = None) -> None:
        self.table = table
        self.odometry = odometry

    def begin(self, frames: Iterable[Frame], sample: Iterable[Frame] = ()) -> Placed:
        """Frames for a new map, in coordinates of the table.

        Args:
            frames: to be fused.
            sample: some of the whole recording, which say what its table is; without poses of
                their own the first frame does.

        Raises:
            InputError: there is no frame, or no table and no pose.
        """
        frames = iter(frames) if self.odometry is None else self.odometry.track(frames)
        first = next(frames, None)
        if first is None:
            raise InputError("no frame of the recording has a measurement; record it again")
        posed = self.odometry is None
        further_frames = list(sample) if posed else []
        alignment = self.table.alignment(first, posed=posed, further_frames=further_frames)
        T = alignment.T_table_world  # noqa: N806
        placed_frames = transformed(itertools.chain([first], frames), T)
        return Placed(Recording(T if posed else None), placed_frames, alignment.note)

    def resume(
        self, frames: Iterable[Frame], before: Recording, last: Frame | None = None
    ) -> Placed:
        """Frames to add to a saved map.

        Args:
            frames: those to add.
            before: the recording of the saved map.
            last: the frame before these, where odometry starts; None = there is none.

        Raises:
            InputError: it is unknown where the frames lie in the map.
        """
        if self.odometry is not None:
            if last is None or last.name not in before.names:
                raise InputError(
                    f"the map was made of {len(before.names)} frames; a recording without poses "
                    "is resumed with the frame after the last of them: give run.start=NUMBER"
                )
            posed_frames = self.odometry.track(itertools.chain([last], frames))
            next(posed_frames)
            start = before.poses[before.names.index(last.name)]
            return Placed(before, transformed(posed_frames, start))
        if before.T_map_world is not None:
            return Placed(before, before.in_map(frames))
        placed = self.begin(frames)
        T = placed.recording.T_map_world  # noqa: N806
        if T is None or not np.array_equal(T, np.eye(4)):
            raise InputError(
                "the saved map does not hold the pose of the recording's world, and that world is "
                "not the table's; fuse the whole recording again"
            )
        return Placed(before if before.names else placed.recording, placed.frames, placed.note)
