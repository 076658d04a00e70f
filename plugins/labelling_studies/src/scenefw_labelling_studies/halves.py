"""Repeatability of maps and labels of a recording without ground truth: two halves compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.data.files.recordings import MeasuredFrames, sampled
from scenefw.data.files.sequences import open_sequence
from scenefw.perception.observation.table_frame import TableFrame
from scenefw.perception.physics.placement import Placement
from scenefw_labelling_studies.measures import of_halves
from scenefw_labelling_studies.repeatability import (
    agreement,
    chance_agreement,
    mutual_iou,
    plane_through,
)

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import Labelling, Odometry
    from scenefw.core.measures import Measure
    from scenefw.core.types import Frame

SURFACE = 0
"""Class id of the table."""

Tracker = Callable[[Sequence[int], str], Iterable[int]]


@dataclass(frozen=True)
class HalvesResult:
    """How well two halves of a recording agree.

    Args:
        values: by strategy, then by measure.
        frames: used, of both halves together.
        note: what was done to place the frames, in words.
    """

    values: Mapping[str, Mapping[str, float]]
    frames: int
    note: str = ""

    @property
    def figures(self) -> dict[str, float]:
        """All values as `<strategy>/<measure>`, and the number of frames."""
        named = {
            f"{strategy}/{name}": value
            for strategy, values in self.values.items()
            for name, value in values.items()
            if np.isfinite(value)
        }
        return {"frames": float(self.frames)} | named

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units and digits of the figures."""
        return of_halves(tuple(self.values))


class LabellingHalves:
    """Fuses the even and the odd frames of a recording apart, and compares the two maps.

    A real recording seldom has true heights or labels. What it can show: whether the same place
    gets the same height and the same label from other frames, and whether a flat table comes out
    flat. Errors that both halves share, such as a wrong scale of depth, don't show.

    Args:
        input: folder of the sequence, as for `run=label`.
        strategies: by name.
        frames: used at most, the first ones; None = all.
        flat: vertices this near z = 0 (m), of those labelled as the surface, say how flat it is.
        table: finds the table in the first frame.
        odometry: finds poses, if `estimate_poses`.
        estimate_poses: the sequence has no poses; odometry finds them.
        intrinsics: file; None = that in the folder.
        depth_scale: metres per unit of integer depth; None = that of the format.

    Raises:
        ConfigError: no input, no strategy, or no odometry where poses are to be estimated.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        strategies: Mapping[str, Labelling],
        frames: int | None = None,
        flat: float = 0.01,
        table: TableFrame | None = None,
        odometry: Odometry | None = None,
        *,
        estimate_poses: bool = False,
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
    ) -> None:
        if input is None:
            raise ConfigError("comparing halves needs input=FOLDER of an RGB-D sequence")
        if not strategies:
            raise ConfigError("no strategy to run; give labelling=[view_based,map_based,hybrid]")
        if estimate_poses and odometry is None:
            raise ConfigError(
                "evaluation.estimate_poses=true needs odometry; leave odometry as it is"
            )
        self.input, self.strategies = Path(input), dict(strategies)
        self.frames, self.flat = frames, flat
        self.placement = Placement(table or TableFrame(), odometry if estimate_poses else None)
        self.options: dict[str, Any] = {
            "require_poses": not estimate_poses,
            "intrinsics": intrinsics,
            "depth_scale": depth_scale,
        }

    def run(self, track: Tracker = lambda frames, _: frames) -> HalvesResult:
        """Values of every strategy; `track` wraps the loop in a progress bar.

        Raises:
            InputError: the sequence is unusable, or has fewer than two frames.
        """
        sequence = open_sequence(self.input, **self.options)
        count = min(len(sequence), self.frames or len(sequence))
        if count < 2:
            raise InputError(f"{self.input} has {count} frames to use; two halves need 2 or more")
        sample = MeasuredFrames(sequence, sampled(range(count)))
        placed = self.placement.begin(MeasuredFrames(sequence, range(count)), sample)
        running = {
            name: (strategy.begin(), strategy.begin()) for name, strategy in self.strategies.items()
        }
        frame_count = 0
        for number, frame in _numbered(track(range(count), "frames"), placed.frames):
            for halves in running.values():
                halves[number % 2].add(frame)
            frame_count = number + 1
        values = {
            name: compared(first.height_map(), second.height_map(), self.flat)
            for name, (first, second) in running.items()
        }
        return HalvesResult(values, frame_count, placed.note)


def compared(first: HeightMap, second: HeightMap, flat: float) -> dict[str, float]:
    """Values of two maps of the same table on the same grid.

    Args:
        first: with labels.
        second: on the same grid.
        flat: vertices this near z = 0 (m), of those labelled as the surface, say how flat it is.

    Raises:
        InputError: they share no vertex that both have seen.
    """
    common = first.seen & second.seen
    if not common.any():
        raise InputError("the two halves show no common part of the table; use more frames")
    difference = (second.heights - first.heights)[common]
    figures = {
        "overlap": float(common.sum() / (first.seen | second.seen).sum()),
        "height_median": float(np.median(np.abs(difference))),
        "height_rms": float(np.sqrt(np.mean(difference**2))),
    } | _flatness(first, flat)
    if first.labels is None or second.labels is None:
        return figures
    pair = (first.labels[common], second.labels[common])
    return figures | {
        "agreement": agreement(*pair),
        "chance": chance_agreement(*pair, len(first.classes)),
        "miou": mutual_iou(*pair, len(first.classes)),
    }


def _flatness(height_map: HeightMap, flat: float) -> dict[str, float]:
    """Tilt and roughness of the plane through what is labelled as the surface, near z = 0."""
    low = height_map.seen & (np.abs(height_map.heights) < flat)
    if height_map.labels is not None:
        low &= height_map.labels == SURFACE
    rows, columns = np.nonzero(low)
    if len(rows) < 3:
        return {}
    places = np.column_stack([columns, rows]) * height_map.grid.spacing
    tilt, roughness = plane_through(places, height_map.heights[low])
    return {"tilt": tilt, "roughness": roughness}


def _numbered(numbers: Iterable[int], frames: Iterator[Frame]) -> Iterator[tuple[int, Frame]]:
    """Frames with their numbers; fewer than announced where empty ones were left out."""
    return ((number, frame) for number, frame in zip(numbers, frames, strict=False))
