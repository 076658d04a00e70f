"""RGB-D sequences with poses: a folder of images, or the format of the TUM RGB-D benchmark."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from scenefw.core.errors import InputError
from scenefw.core.files import in_order, write_text
from scenefw.core.folders import replacing_folder
from scenefw.core.labels import UNKNOWN
from scenefw.core.types import Frame
from scenefw.data.files import poses as pose_files
from scenefw.data.files import record3d
from scenefw.data.files.image_poses import folder_poses, no_poses, require_times
from scenefw.data.files.intrinsics import intrinsics_file, read_calibration
from scenefw.data.files.layouts import TUM_UNIT, Surroundings
from scenefw.data.files.pose_conventions import check_conventions, converted
from scenefw.data.files.sequence_frames import IGNORED, Entry, FrameFiles, require_size
from scenefw.data.files.timed_lines import nearest_times, timed_lines, timed_poses, unmatched_note

_COLOURS = ("rgb", "colour", "color")
_DEPTHS = (".png", ".npy", ".exr")
_IMAGES = (".png", ".jpg", ".jpeg")


class _Sequence(ABC):
    """Numbered frames; a subclass finds their files."""

    _frames: FrameFiles
    notes: tuple[str, ...]
    """What the files left open and how they were read, a line each."""

    @abstractmethod
    def __init__(self, path: Path | str) -> None: ...

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._frames.entries)

    @property
    def depth_files(self) -> list[Path]:
        """Of the frames."""
        return [entry.depth for entry in self._frames.entries]

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

    def _check_poses(
        self,
        path: Path,
        file_poses: Sequence[NDArray[np.float64]],
        convention: str,
        largest_jump: float | None,
    ) -> None:
        """Raises an InputError if the poses are of another convention or unit, or jump."""
        entries = self._frames.entries
        if len(file_poses) < len(entries):
            return
        names = [entry.depth.stem for entry in entries]
        self.notes += check_conventions(self, file_poses, names, str(path), convention)
        pose_files.require_metres(self.poses, str(path))
        if largest_jump is not None:
            numbers = [entry.number for entry in entries]
            pose_files.require_smooth(self.poses, largest_jump, str(path), numbers)


class RGBDFolder(_Sequence):
    """A folder with `depth/`, maybe `rgb/` and `labels/`, `poses.txt` and an intrinsics file.

    Depth images are 16-bit .png, .npy or .exr, in the order of their names, 2 before 10; colours
    and labels have the same names (labels: 8-bit .png of class ids, 255 = unknown). `poses.txt`
    holds one camera-to-world pose per depth image: 16 or 12 numbers row by row, or x y z qx qy qz
    qw, in the same order, or in any if each line begins with the name of its image.
    `poses/NAME.txt`, one file per depth image, does as well, and so do the folders that ScanNet and
    Record3D export. Images whose pose is not finite are left out.

    Args:
        path: the folder.
        intrinsics: file; None = intrinsics.json (.yaml, .txt), camera.* or K.* in the folder.
        depth_scale: metres per unit of integer depth; None = 0.001. An error with floats.
        largest_jump: most that the camera moves between two frames (m); None = any.
        poses: convention of the poses, as `pose_conventions.converted` takes it.
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
        poses: str = "opencv",
        *,
        require_poses: bool = True,
    ) -> None:
        path = Path(path)
        folder = path / "depth"
        if not folder.is_dir():
            raise InputError(f"no folder {folder}; expected depth/, rgb/ and poses.txt in {path}")
        depths = [
            file
            for file in in_order(folder.iterdir())
            if file.suffix.lower() in _DEPTHS and not file.name.startswith(".")  # nor "._" of macOS
        ]
        if not depths:
            raise InputError(
                f"no depth image in {folder}; expected 16-bit .png, .npy or .exr files"
            )
        file_poses = folder_poses(path, depths, require=require_poses)
        colours, labels = _beside(path, _COLOURS, depths), _beside(path, ("labels",), depths)
        matrices: Sequence[NDArray[np.float64] | None] = [None] * len(depths)
        self.notes, ordered = (), True
        if file_poses is not None:
            matrices, self.notes = file_poses.poses, file_poses.notes
            ordered = file_poses.ordered
        entries = [
            Entry(number, depth, colour, label, None if pose is None else converted(pose, poses))
            for number, (depth, colour, label, pose) in enumerate(
                zip(depths, colours, labels, matrices, strict=True)
            )
            if pose is not None or file_poses is None
        ]
        self._frames = FrameFiles(
            entries, _intrinsics(path, intrinsics), depth_scale, Surroundings(root=path)
        )
        valid = [pose for pose in matrices if pose is not None]
        self._check_poses(path, valid, poses, largest_jump if ordered else None)


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
        poses: convention of the poses, as `pose_conventions.converted` takes it.
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
        poses: str = "opencv",
        *,
        require_poses: bool = True,
    ) -> None:
        path = Path(path)
        depth_times, depths = timed_lines(path / "depth.txt")
        colour_times, colours = timed_lines(path / "rgb.txt")
        require_times(path / "depth.txt", depth_times, depths, largest_delay)
        require_times(path / "rgb.txt", colour_times, colours, largest_delay)
        colour_of = nearest_times(depth_times, colour_times, largest_delay)
        matrices: list[NDArray[np.float64]] = []
        pose_of = np.full(len(depths), -1)
        self.notes = unmatched_note("colour image", depth_times, colour_times, colour_of)
        if (path / "groundtruth.txt").is_file():
            reader = pose_files.PoseReader(path / "groundtruth.txt")
            pose_times, matrices = timed_poses(path / "groundtruth.txt", reader)
            pose_of = nearest_times(depth_times, pose_times, largest_delay)
            self.notes += reader.notes
            self.notes += unmatched_note("pose", depth_times, pose_times, pose_of)
        if require_poses and (pose_of < 0).all():
            raise no_poses(path, "groundtruth.txt", f"poses within {largest_delay} s of an image")
        entries = [
            Entry(
                number,
                path / words[0],
                path / colours[colour][0] if colour >= 0 else None,
                None,
                converted(matrices[pose], poses) if pose >= 0 else None,
            )
            for number, (words, colour, pose) in enumerate(
                zip(depths, colour_of, pose_of, strict=True)
            )
            if pose >= 0 or not require_poses
        ]
        around = Surroundings(TUM_UNIT, path)
        self._frames = FrameFiles(entries, _intrinsics(path, intrinsics), depth_scale, around)
        valid = [matrices[pose] for pose in pose_of if pose >= 0]
        self._check_poses(path, valid, poses, largest_jump)


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
            require_size(frame, camera.width, camera.height)
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


def _beside(path: Path, names: Sequence[str], depths: list[Path]) -> list[Path | None]:
    """Images of the same names as the depth images in the first of some folders that exists."""
    folder = next((path / name for name in names if (path / name).is_dir()), None)
    if folder is None:
        return [None] * len(depths)
    images: list[Path | None] = []
    for depth in depths:
        files = (folder / f"{depth.stem}{suffix}" for suffix in (*_IMAGES, depth.suffix))
        file = next((file for file in files if file.is_file()), None)
        if file is None:
            raise InputError(f"no image {folder / depth.stem}.png beside {depth}; add it")
        images.append(file)
    return images


def _intrinsics(path: Path, override: Path | str | None) -> Path | None:
    """The file with the intrinsics of a sequence; None if its own format says them."""
    if override is None and (path / record3d.FILE).is_file():
        return None
    file = intrinsics_file([path]) if override is None else Path(override)
    if file is None or not file.is_file():
        raise InputError(
            f"no intrinsics {override or f'in {path}'}; put intrinsics.json with fx, fy, cx, cy "
            "there or give run.intrinsics=PATH (the TUM benchmark's own default: 525, 525, 319.5, "
            "239.5)"
        )
    read_calibration(file)
    return file


def _write_image(path: Path, values: NDArray[Any]) -> None:
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.ascontiguousarray(values)).save(path)
