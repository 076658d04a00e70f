"""Labels a recording: one map of an RGB-D sequence, or a one-frame map of each single image."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import require_apart, require_free, require_writable
from scenefw.core.folders import adding_to_folder
from scenefw.core.labels import UNKNOWN
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.data.files.readers import find_images, read_frame
from scenefw.data.files.recordings import STATE, MeasuredFrames, Recording, sampled
from scenefw.data.files.sequences import open_sequence
from scenefw.perception.observation.levels import higher_level, lower_level
from scenefw.perception.observation.table_frame import TableFrame
from scenefw.perception.physics.placement import Placement
from scenefw.report.console import track
from scenefw.report.labelling.growth import Growth
from scenefw.report.labelling.pictures import map_picture
from scenefw.report.pictures import save_picture
from scenefw.tasks.several_images import finished, require_some

if TYPE_CHECKING:
    from scenefw.core.height_maps import HeightGrid, HeightMap
    from scenefw.core.labelling_protocols import Labelling, Odometry, RunningLabelling
    from scenefw.core.types import Frame
    from scenefw.data.files.recordings import NumberedFrames
    from scenefw.perception.physics.placement import Placed

MAP, PICTURE = "map.npz", "map.png"


class MapWatcher(Protocol):
    """Is shown a map while it grows."""

    def show(self, height_map: HeightMap, title: str, frame: Frame | None = None) -> None:
        """Takes a map.

        Args:
            height_map: of the frames so far.
            title: how many these are, or the name of the image.
            frame: the latest one, in the coordinates of the map.
        """


class Label:
    """Fuses and labels a recording of a camera.

    A sequence (folder with `depth/`, or TUM's format) becomes one map: `map.npz`, `map.png`, and
    while it grows `growth/000020.png` ... and `growth.gif`. It is saved as it grows, and when it is
    interrupted, with the poses of its frames; `resume` continues it. Frames without a
    measurement are left out. Any other depth image, or each of a folder of them, becomes a map of
    its own; an unusable one is left out.

    Args:
        input: folder of a sequence, a depth image or a folder of images.
        strategies: by name; one of them.
        grid: of the map.
        output: the run's folder.
        resume: a saved map to continue.
        start: frames of the sequence to leave out, e.g. those that the saved map holds.
        frames: frames at most; None = all.
        table: finds the table.
        odometry: finds poses, if `estimate_poses`.
        estimate_poses: the sequence has no poses; odometry finds them.
        intrinsics: file; None = that in the folder.
        depth_scale: metres per unit of integer depth; None = that of the format.
        largest_jump: most that the camera moves between two frames (m); None = any.
        poses: convention of the poses, as `pose_conventions.converted` takes it.
        picture_every: frames from one picture of the growing map to the next; None = no pictures.
        save_every: frames from one saved map to the next.

    Raises:
        ConfigError: no input, not one strategy, or a number out of range.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        strategies: Mapping[str, Labelling],
        grid: HeightGrid,
        output: str | Path,
        resume: str | Path | None = None,
        start: int = 0,
        frames: int | None = None,
        table: TableFrame | None = None,
        odometry: Odometry | None = None,
        *,
        estimate_poses: bool = False,
        intrinsics: str | Path | None = None,
        depth_scale: float | None = None,
        largest_jump: float | None = 0.2,
        poses: str = "opencv",
        picture_every: int | None = 20,
        save_every: int = 200,
    ) -> None:
        if input is None:
            raise ConfigError("no input; give input=FOLDER of an RGB-D sequence or depth images")
        if len(strategies) != 1:
            raise ConfigError(
                f"labelling = [{', '.join(strategies)}]: expected one strategy, such as "
                "labelling=hybrid (or view_based, map_based)"
            )
        POSITIVE.require(depth_scale=depth_scale, largest_jump=largest_jump)
        NOT_NEGATIVE.require(start=start, picture_every=picture_every)
        COUNT.require(frames=frames, save_every=save_every)
        require_apart(output, input)
        self.input = Path(input)
        self.strategy = next(iter(strategies.values()))
        self.grid = grid
        self.output = Path(output)
        self.resume = Path(resume) if resume else None
        self.start, self.frames = start, frames
        self.table = table or TableFrame()
        self.odometry = odometry
        self.estimate_poses = estimate_poses
        self.options: dict[str, Any] = {
            "intrinsics": intrinsics,
            "depth_scale": depth_scale,
            "largest_jump": largest_jump,
            "poses": poses,
        }
        self.picture_every, self.save_every = picture_every, save_every

    def run(self, watcher: MapWatcher | None = None, interval: int = 5) -> dict[str, float]:
        """Labels all frames; returns their number, coverage and seconds per frame.

        Args:
            watcher: is shown the map while it grows.
            interval: frames from one shown map to the next.

        Raises:
            InputError: the input or the saved map is unusable.
            IncompleteError: some of several images are unusable.
            StorageError: the output folder can't be written.
        """
        require_writable(self.output)
        is_sequence = (self.input / "depth").is_dir() or (self.input / "depth.txt").is_file()
        return self._sequence(watcher, interval) if is_sequence else self._images(watcher)

    def _sequence(self, watcher: MapWatcher | None, interval: int) -> dict[str, float]:
        for name in (MAP, PICTURE):
            require_free(self.output / name)
        sequence = open_sequence(self.input, require_poses=not self.estimate_poses, **self.options)
        last = (
            len(sequence) if self.frames is None else min(len(sequence), self.start + self.frames)
        )
        if self.start >= last:
            raise InputError(
                f"run.start = {self.start}: expected less than {len(sequence)}; {self.input} has "
                f"{len(sequence)} frames"
            )
        measured = MeasuredFrames(sequence, range(self.start, last))
        sample = list(MeasuredFrames(sequence, sampled(range(self.start, last))))
        notes = dict.fromkeys(note for frame in sample for note in frame.notes)
        running, placed = self._begin(sequence, measured, sample)
        for note in (*sequence.notes, *notes, placed.note):
            if note:
                print(f"{self.input}: {note}", file=sys.stderr)
        growth, recording = Growth(self.output), placed.recording
        began, number = time.perf_counter(), 0
        try:
            bar = track(range(self.start, last), "frames")
            for count, (_, frame) in enumerate(zip(bar, placed.frames, strict=False), 1):
                running.add(frame)
                number = count
                recording = recording.extended(frame)
                if self.picture_every and number % self.picture_every == 0:
                    growth.show(running.height_map(), self.start + number)
                if watcher is not None and number % interval == 1 % interval:
                    watcher.show(running.height_map(), _frames(self.start + number), frame)
                if number % self.save_every == 0:
                    self._save(running, recording)
        except InputError as error:
            if not number:
                raise
            place = self.output / MAP
            raise InputError(f"{error} (the map of the frames before it is {place})") from error
        finally:  # an interrupted run still saves its map
            if number:
                seconds = time.perf_counter() - began
                height_map = self._save(running, recording)
        if measured.empty:
            empty = ", ".join(map(str, measured.empty))
            print(f"{self.input}: skipped frames without a measurement: {empty}", file=sys.stderr)
        if not number:
            raise InputError(f"no frame of {self.input} has a measurement; record it again")
        if self.picture_every:
            growth.show(height_map, self.start + number)
            growth.film()
        if watcher is not None:
            watcher.show(height_map, _frames(self.start + number), frame)
        save_picture(map_picture(height_map), self.output / PICTURE)
        _say_other_tables(self.input, height_map)
        _say_doubt(self.input, height_map)
        return {
            "frames": float(number),
            "left_out": float(len(measured.empty)),
            "seconds_per_frame": seconds / number,
        } | _facts(height_map)

    def _begin(
        self, sequence: NumberedFrames, measured: Iterable[Frame], sample: Iterable[Frame]
    ) -> tuple[RunningLabelling, Placed]:
        """A new or resumed map, and the frames to add."""
        if self.estimate_poses and self.odometry is None:
            raise ConfigError("run.estimate_poses=true needs a method; leave odometry as it is")
        placement = Placement(self.table, self.odometry if self.estimate_poses else None)
        if self.resume is None:
            return self.strategy.begin(), placement.begin(measured, sample)
        saved = load_map(self.resume, self.grid)
        before = Recording.from_state(saved.states.get(STATE, {}))
        last = sequence[self.start - 1] if self.estimate_poses and self.start else None
        placed = placement.resume(measured, before, last)
        return self.strategy.begin(saved.height_map, saved.states), placed

    def _save(self, running: RunningLabelling, recording: Recording) -> HeightMap:
        height_map = running.height_map()
        save_map(self.output / MAP, height_map, {**running.states(), STATE: recording.state()})
        return height_map

    def _images(self, watcher: MapWatcher | None) -> dict[str, float]:
        """A map of each image."""
        if self.start or self.frames is not None or self.resume is not None:
            raise ConfigError(
                f"run.start, run.frames and run.resume are for sequences, and {self.input} is no "
                "folder of one (depth/ or depth.txt); leave them out"
            )
        images = find_images(self.input)
        began, coverage = time.perf_counter(), []
        failures: dict[Path, InputError] = {}
        base = self.input if self.input.is_dir() else self.input.parent
        for image in track(images, "images"):
            folder = self.output / image.relative_to(base).with_suffix("")
            try:
                frame, height_map = self._image(image, folder)
                coverage.append(_facts(height_map)["coverage"])
                if watcher is not None:
                    watcher.show(height_map, image.stem, frame)
            except InputError as error:
                failures[image] = error
        require_some(failures, len(images))
        figures = {
            "coverage": float(np.mean(coverage)),
            "seconds_per_image": (time.perf_counter() - began) / len(images),
        }
        return finished(figures, failures, len(images))

    def _image(self, image: Path, folder: Path) -> tuple[Frame, HeightMap]:
        options = {key: self.options[key] for key in ("intrinsics", "depth_scale")}
        frame = self.table.rectified(read_frame(image, **options))
        for note in frame.notes:
            print(f"{image}: {note}", file=sys.stderr)
        running = self.strategy.begin()
        running.add(replace(frame, labels=None))
        height_map = running.height_map()
        with adding_to_folder(folder) as temporary:
            save_map(temporary / MAP, height_map, running.states())
            save_picture(map_picture(height_map), temporary / PICTURE)
        _say_other_tables(image, height_map)
        _say_doubt(image, height_map)
        return frame, height_map


def _frames(number: int) -> str:
    return f"{number} frame{'s' * (number > 1)}"


def _facts(height_map: HeightMap) -> dict[str, float]:
    """Share of vertices seen, and among these the share of each class."""
    facts = {"coverage": float(height_map.seen.mean())}
    if height_map.labels is not None and height_map.seen.any():
        labels = height_map.labels[height_map.seen]
        facts |= {
            f"share/{name}": float(np.mean(labels == i))
            for i, name in enumerate(height_map.classes)
        }
    return facts


def _say_other_tables(path: Path, height_map: HeightMap) -> None:
    """Prints a line for a second table in the map: labels follow the height above the first."""
    depth, height = lower_level(height_map.heights), higher_level(height_map)
    places = [f"{100 * depth:.0f} cm below"] if depth is not None else []
    places += [f"{100 * height:.0f} cm above"] if height is not None else []
    if places:
        print(
            f"{path}: another wide surface lies {' and one '.join(places)} the table; labels there "
            "are doubtful, as all heights count from the table: record each table alone",
            file=sys.stderr,
        )


def _say_doubt(path: Path, height_map: HeightMap) -> None:
    """Prints a line if the table itself is labelled as things.

    The table is the plane of most of a map, so the half of the map that is nearest to its plane
    shows it, and at most a few flat things. The first class is the surface.
    """
    if height_map.labels is None:
        return
    is_labelled = height_map.seen & (height_map.labels != UNKNOWN)
    labels, distances = height_map.labels[is_labelled], np.abs(height_map.heights[is_labelled])
    if not len(labels):
        return
    labels = labels[distances <= np.median(distances)]
    things = labels[labels > 0]
    if len(things) > len(labels) / 2:
        name = height_map.classes[np.bincount(things).argmax()]
        print(
            f"{path}: of the half of the map nearest to the table's plane, "
            f"{len(things) / len(labels):.0%} is labelled as things, mostly {name}; these "
            "labels are doubtful. Heights alone tell tables from things: labelling=map_based "
            "label_source@map_label_source=by_height",
            file=sys.stderr,
        )
