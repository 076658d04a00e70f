"""RGB-D sequences with poses: a folder of images, or the format of the TUM RGB-D benchmark."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import in_order, unreadable, write_text
from scenefw.core.folders import replacing_folder
from scenefw.core.labels import UNKNOWN
from scenefw.core.types import Frame
from scenefw.data.files import poses as pose_files
from scenefw.data.files.image_poses import folder_poses, no_poses, require_times
from scenefw.data.files.intrinsics import read_intrinsics
from scenefw.data.files.layouts import TUM_UNIT, Surroundings
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.data.files.readers import read_frame

IGNORED = 255
"""Value of unknown pixels in an image of labels."""

_INTRINSICS = tuple(
    f"{stem}{suffix}"
    for stem in ("intrinsics", "camera", "K")
    for suffix in (".json", ".yaml", ".yml", ".txt")
)
_COLOURS = ("rgb", "colour", "color")
_IMAGES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class _Entry:
    """Files of one frame and its pose."""

    depth: Path
    colour: Path | None
    labels: Path | None
    pose: NDArray[np.float64] | None


class _Sequence(ABC):
    """Numbered frames; a subclass finds their files."""

    _frames: _Frames

    @abstractmethod
    def __init__(self, path: Path | str) -> None: ...

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._frames.entries)

    @property
    def poses(self) -> list[NDArray[np.float64]]:
        """Camera to world (4, 4) of each frame, the origin where it has none."""
        return [np.eye(4) if e.pose is None else e.pose for e in self._frames.entries]

    def __getitem__(self, index: int) -> Frame:
        """One frame; raises an InputError if its files are unusable."""
        return self._frames.read(index)

    def __iter__(self) -> Iterator[Frame]:
        """All frames in order."""
        return (self[i] for i in range(len(self)))


class RGBDFolder(_Sequence):
    """A folder with `depth/`, maybe `rgb/` and `labels/`, `poses.txt` and an intrinsics file.

    Depth images are 16-bit .png or .npy, in the order of their names, 2 before 10; colours and
    labels have the same names (labels: 8-bit .png of class ids, 255 = unknown). `poses.txt` holds
    one camera-to-world pose per depth image: 16 or 12 numbers row by row, or x y z qx qy qz qw,
    in the same order, or in any if each line begins with the name of its image. `poses/NAME.txt`,
    one file per depth image, does as well.

    Args:
        path: the folder.
        intrinsics: file; None = intrinsics.json (.yaml, .txt), camera.* or K.* in the folder.
        depth_scale: metres per unit of integer depth; None = 0.001. An error with floats.
        largest_jump: most that the camera moves between two frames (m); None = any.
        require_poses: raise an error if there are none, instead of frames at the origin.

    Raises:
        InputError: something is missing or does not fit; the message says what to do.
    """

    def __init__(
        self,
        path: Path | str,
        intrinsics: Path | str | None = None,
        depth_scale: float | None = None,
        largest_jump: float | None = 0.2,
        *,
        require_poses: bool = True,
    ) -> None:
        path = Path(path)
        folder = path / "depth"
        if not folder.is_dir():
            raise InputError(f"no folder {folder}; expected depth/, rgb/ and poses.txt in {path}")
        depths = [file for file in in_order(folder.iterdir()) if file.suffix in (".png", ".npy")]
        if not depths:
            raise InputError(f"no depth image in {folder}; expected 16-bit .png or .npy files")
        poses = folder_poses(path, depths, largest_jump, require_poses)
        colours, labels = _beside(path, _COLOURS, depths), _beside(path, ("labels",), depths)
        entries = [_Entry(*parts) for parts in zip(depths, colours, labels, poses, strict=True)]
        self._frames = _Frames(entries, _intrinsics(path, intrinsics), depth_scale, Surroundings())


class TUMSequence(_Sequence):
    """A sequence of the TUM RGB-D benchmark (Sturm et al. 2012).

    `rgb.txt` and `depth.txt` list times and files, `groundtruth.txt` times and poses (x y z qx qy
    qz qw); every depth image gets the colour image and the pose nearest in time. Depth images
    without a pose near enough are left out. Where files are named by times, those must agree with
    the times of their lines.

    Args:
        path: the folder.
        intrinsics: file; None = intrinsics.json (.yaml, .txt), camera.* or K.* in the folder.
        depth_scale: metres per unit of integer depth; None = 1/5000, the benchmark's.
        largest_jump: most that the camera moves between two frames (m); None = any.
        largest_delay: most between a depth image and its colour image or pose (s).
        require_poses: raise an error if there are none, instead of frames at the origin.

    Raises:
        InputError: something is missing or does not fit; the message says what to do.
    """

    def __init__(
        self,
        path: Path | str,
        intrinsics: Path | str | None = None,
        depth_scale: float | None = None,
        largest_jump: float | None = 0.2,
        largest_delay: float = 0.02,
        *,
        require_poses: bool = True,
    ) -> None:
        path = Path(path)
        depth_times, depths = _timed(path / "depth.txt")
        colour_times, colours = _timed(path / "rgb.txt")
        require_times(path / "depth.txt", depth_times, depths, largest_delay)
        require_times(path / "rgb.txt", colour_times, colours, largest_delay)
        colour_of = _nearest(depth_times, colour_times, largest_delay)
        poses: list[NDArray[np.float64]] = []
        pose_of = np.full(len(depths), -1)
        if (path / "groundtruth.txt").is_file():
            pose_times, poses = _timed_poses(path / "groundtruth.txt")
            pose_of = _nearest(depth_times, pose_times, largest_delay)
        if require_poses and (pose_of < 0).all():
            raise no_poses(path, "groundtruth.txt", f"poses within {largest_delay} s of an image")
        entries = [
            _Entry(
                path / words[0],
                path / colours[colour][0] if colour >= 0 else None,
                None,
                poses[pose] if pose >= 0 else None,
            )
            for words, colour, pose in zip(depths, colour_of, pose_of, strict=True)
            if pose >= 0 or not require_poses
        ]
        entry_poses = [entry.pose for entry in entries if entry.pose is not None]
        pose_files.require_metres(entry_poses, str(path))
        if largest_jump is not None:
            pose_files.require_smooth(entry_poses, largest_jump, str(path))
        around = Surroundings(TUM_UNIT)
        self._frames = _Frames(entries, _intrinsics(path, intrinsics), depth_scale, around)


def open_sequence(path: Path | str, **options: Any) -> RGBDFolder | TUMSequence:
    """The sequence at a path: TUM's format if `rgb.txt` and `depth.txt` are there, else a folder.

    Raises:
        InputError: nothing usable is there.
    """
    path = Path(path)
    if not path.is_dir():
        raise InputError(f"no folder {path}; give the folder of an RGB-D sequence")
    if (path / "rgb.txt").is_file() and (path / "depth.txt").is_file():
        return TUMSequence(path, **options)
    return RGBDFolder(path, **options)


def transformed(frames: Iterable[Frame], T: NDArray[np.float64]) -> Iterator[Frame]:  # noqa: N803
    """The frames in another world: T (4, 4) takes the old world's coordinates to the new one's."""
    for frame in frames:
        yield replace(frame, camera=frame.camera.moved(T @ frame.camera.T_world_camera))


def write_sequence(
    folder: Path | str,
    frames: Iterable[Frame],
    classes: Sequence[str] = (),
    *,
    ordered: bool = True,
) -> Path:
    """Writes frames as a folder that `RGBDFolder` reads; depth in millimetres, 16 bits.

    Args:
        folder: where to; appears when all is written, in the place of an earlier sequence.
        frames: of one camera; labels, where they are, as class ids.
        classes: names by id, written to classes.json.
        ordered: the frames are a video, so that poses must not jump.

    Raises:
        InputError: no frame, or frames of several image sizes.
        StorageError: the folder can't be written, or the disk is full.
    """
    poses, camera = [], None
    with replacing_folder(folder) as new:
        for index, frame in enumerate(frames):
            camera = camera or frame.camera
            _require_size(frame, camera.width, camera.height)
            _write_frame(new, index, frame)
            poses.append(frame.camera.T_world_camera)
        if camera is None:
            raise InputError(f"no frame to write to {folder}; give one or more")
        pose_files.write_poses(new / "poses.txt", poses, ordered=ordered)
        values = {key: getattr(camera, key) for key in ("fx", "fy", "cx", "cy")}
        write_text(new / "intrinsics.json", json.dumps(values, indent=1) + "\n")
        if classes:
            write_text(new / "classes.json", json.dumps(list(classes), indent=1) + "\n")
    return Path(folder)


def _write_frame(folder: Path, index: int, frame: Frame) -> None:
    millimetres = np.rint(np.clip(frame.depth * 1000, 0, 65535)).astype(np.uint16)
    _write_image(folder / "depth" / f"{index:06d}.png", millimetres)
    if frame.colour is not None:
        _write_image(folder / "rgb" / f"{index:06d}.png", frame.colour)
    if frame.labels is not None:
        labels = np.where(frame.labels == UNKNOWN, IGNORED, frame.labels).astype(np.uint8)
        _write_image(folder / "labels" / f"{index:06d}.png", labels)


@dataclass(frozen=True)
class _Frames:
    """Reads the frames of a list of files; all have the size of the first."""

    entries: list[_Entry]
    intrinsics: Path
    depth_scale: float | None
    around: Surroundings

    def read(self, index: int) -> Frame:
        entry = self.entries[index]
        frame = read_frame(
            entry.depth,
            intrinsics=self.intrinsics,
            depth_scale=self.depth_scale,
            around=self.around,
        )
        _require_size(frame, *_size(self.entries[0].depth))
        colour = None if entry.colour is None else _image(entry.colour, "RGB", frame)
        labels = None
        if entry.labels is not None:
            labels = _image(entry.labels, "L", frame).astype(np.int32)
            labels[labels == IGNORED] = UNKNOWN
        camera = frame.camera if entry.pose is None else frame.camera.moved(entry.pose)
        return replace(frame, camera=camera, colour=colour, labels=labels)


def _beside(path: Path, names: Sequence[str], depths: list[Path]) -> list[Path | None]:
    """Images of the same names as the depth images in the first of some folders that exists."""
    folder = next((path / name for name in names if (path / name).is_dir()), None)
    if folder is None:
        return [None] * len(depths)
    images: list[Path | None] = []
    for depth in depths:
        files = (folder / f"{depth.stem}{suffix}" for suffix in _IMAGES)
        file = next((file for file in files if file.is_file()), None)
        if file is None:
            raise InputError(f"no image {folder / depth.stem}.png beside {depth}; add it")
        images.append(file)
    return images


def _intrinsics(path: Path, override: Path | str | None) -> Path:
    candidates = [Path(override)] if override else [path / name for name in _INTRINSICS]
    intrinsics_file = next((file for file in candidates if file.is_file()), None)
    if intrinsics_file is None:
        raise InputError(
            f"no intrinsics {override or f'in {path}'}; put intrinsics.json with fx, fy, cx, cy "
            "there or give run.intrinsics=PATH (the TUM benchmark's own default: 525, 525, 319.5, "
            "239.5)"
        )
    read_intrinsics(intrinsics_file)
    return intrinsics_file


def _timed(path: Path) -> tuple[NDArray[np.float64], list[list[str]]]:
    """Times and the words after them, in the order of time."""
    lines = pose_files.read_numbers(path)
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


def _timed_poses(path: Path) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    times, lines = _timed(path)
    return times, [
        pose_files.pose_of(words, f"time {time} of {path}")
        for time, words in zip(times, lines, strict=True)
    ]


def _nearest(
    times: NDArray[np.float64], candidates: NDArray[np.float64], max_delay: float
) -> NDArray[np.int64]:
    """Index of the nearest other time, -1 where none is within `max_delay` seconds."""
    after = np.clip(np.searchsorted(candidates, times), 1, max(len(candidates) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(candidates) - 1)
    closer = np.abs(candidates[after] - times) < np.abs(candidates[before] - times)
    nearest = np.where(closer, after, before)
    return np.where(np.abs(candidates[nearest] - times) <= max_delay, nearest, -1)


def _size(path: Path) -> tuple[int, int]:
    """Width and height of a depth image, from its header if it has one."""
    try:
        if path.suffix == ".npy":
            height, width = np.load(path, mmap_mode="r", allow_pickle=False).shape[:2]
            return int(width), int(height)
        with Image.open(path) as image:
            return image.size
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {path}: {reason}") from error


def _require_size(frame: Frame, width: int, height: int) -> None:
    size = (frame.camera.width, frame.camera.height)
    if size != (width, height):
        raise InputError(
            f"frame {frame.name} is {size[0]} x {size[1]} pixels, the first one {width} x "
            f"{height}; all frames of a sequence must have the same size"
        )


def _image(path: Path, mode: str, frame: Frame) -> NDArray[np.uint8]:
    try:
        with Image.open(path) as image:
            values = np.array(image.convert(mode))
    except DAMAGED_PICTURE as error:
        reason = unreadable(error, "is the file complete?")
        raise InputError(f"cannot read {path}: {reason}") from error
    if values.shape[:2] != frame.depth.shape:
        raise InputError(
            f"{path} has shape {values.shape[:2]}, its depth image {frame.depth.shape}; both must "
            "be aligned images of one size"
        )
    return values


def _write_image(path: Path, values: NDArray[Any]) -> None:
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.ascontiguousarray(values)).save(path)
