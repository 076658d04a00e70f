"""Frames of a recording that can be used, and their poses in the map made of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import EmptyImageError, InputError
from scenefw.core.types import Float64, Frame

STATE = "recording"
"""Name of a recording among the states of a saved map."""


@dataclass(frozen=True)
class Recording:
    """Camera poses in a map's frame, kept with the map so that frames can be placed again.

    Args:
        T_map_world: (4, 4), takes the world of the recording's own poses to the map's frame; None =
            it has no poses of its own, odometry estimated them.
        names: of the frames that the map was made of.
        poses: (4, 4) each, camera to map.
    """

    T_map_world: Float64 | None = None
    names: tuple[str, ...] = ()
    poses: tuple[Float64, ...] = ()

    def state(self) -> dict[str, NDArray[Any]]:
        """Arrays that `from_state` restores it from."""
        poses = np.array(self.poses, dtype=np.float64).reshape(-1, 4, 4)
        arrays: dict[str, NDArray[Any]] = {"names": np.array(self.names, np.str_), "poses": poses}
        return arrays if self.T_map_world is None else arrays | {"T_map_world": self.T_map_world}

    @classmethod
    def from_state(cls, state: Mapping[str, NDArray[Any]]) -> Recording:
        """The recording of a saved map.

        Raises:
            InputError: the state is damaged.
        """
        T, poses = state.get("T_map_world"), state.get("poses", np.zeros((0, 4, 4)))  # noqa: N806
        names = [str(name) for name in state.get("names", ())]
        if (T is not None and T.shape != (4, 4)) or poses.shape != (len(names), 4, 4):
            raise InputError("the poses in the saved map are damaged; fuse its recording again")
        return cls(T, tuple(names), tuple(poses))

    def extended(self, frame: Frame) -> Recording:
        """The same with one more frame, whose camera pose is in map coordinates."""
        pose = np.asarray(frame.camera.T_world_camera)
        return replace(self, names=(*self.names, frame.name), poses=(*self.poses, pose))

    @property
    def poses_estimated(self) -> bool:
        """Whether odometry found its poses, so that only frames of the map have any."""
        return self.T_map_world is None and bool(self.names)

    def in_map(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """Frames as they were read, placed in the map's frame.

        If poses were estimated, frames that the map was not made of are left out. Poses are taken
        as they are if the map holds no recording.
        """
        for frame in frames:
            if self.T_map_world is not None:
                pose = self.T_map_world @ frame.camera.T_world_camera
            elif not self.names:
                pose = frame.camera.T_world_camera
            elif frame.name in self.names:
                pose = self.poses[self.names.index(frame.name)]
            else:
                continue
            yield replace(frame, camera=frame.camera.moved(pose))


class NumberedFrames(Protocol):
    """A sequence of frames, such as those of `open_sequence`."""

    def __getitem__(self, index: int) -> Frame:
        """One frame."""


_SAMPLED = 8


def sampled(numbers: range) -> list[int]:
    """Some numbers of frames, spread over a recording."""
    return [numbers[n] for n in np.unique(np.linspace(0, len(numbers) - 1, _SAMPLED).astype(int))]


class MeasuredFrames:
    """Frames of a sequence without those in which nothing is measured, as of a covered lens.

    Args:
        sequence: of frames.
        numbers: those to read.

    Attributes:
        empty: numbers left out so far.
    """

    def __init__(self, sequence: NumberedFrames, numbers: Iterable[int]) -> None:
        self.sequence = sequence
        self.numbers = numbers
        self.empty: list[int] = []

    def __iter__(self) -> Iterator[Frame]:
        """Frames in order; raises an InputError if files are unusable otherwise."""
        for number in self.numbers:
            try:
                frame = self.sequence[number]
            except EmptyImageError:
                self.empty.append(number)
                continue
            yield frame
