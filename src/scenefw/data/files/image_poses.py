"""Which pose belongs to which image: by name where names are given, else by order."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.data.files.poses import UNORDERED, PoseReader, read_numbers
from scenefw.data.files.record3d import record3d_poses
from scenefw.data.files.structured import read_text

Poses = list[NDArray[np.float64] | None]

_FOLDERS = ("poses", "pose")

_NAMED = (8, 13, 17)
"""Words of a line that begins with a name: it and the 7, 12 or 16 numbers of a pose."""

_TIME = re.compile(r"[0-9]+\.[0-9]+")


@dataclass(frozen=True, eq=False)
class FolderPoses:
    """Poses of the images of a recording.

    Args:
        poses: `T_world_camera` (4, 4) of each image; None where it has none.
        notes: what they left open, a line each.
        ordered: the images are a video, so that poses must not jump.
    """

    poses: Sequence[NDArray[np.float64] | None]
    notes: tuple[str, ...] = ()
    ordered: bool = True


def folder_poses(path: Path, images: Sequence[Path], *, require: bool) -> FolderPoses | None:
    """The poses of a sequence, None where nothing holds any.

    Args:
        path: the folder with `poses.txt`, with a text file per image in `poses/` (ScanNet:
            `pose/`), or with Record3D's `metadata.json`.
        images: in order.
        require: raise an error if there are no poses.

    Raises:
        InputError: poses are missing, unusable, or not those of the images.
    """
    file = path / "poses.txt"
    folder = next((path / name for name in _FOLDERS if (path / name).is_dir()), None)
    reader = PoseReader(folder or file)
    poses: Sequence[NDArray[np.float64] | None] | None
    if file.is_file():
        poses = _listed(file, images, reader)
    elif folder is not None:
        poses = [_image_pose(folder, image, reader) for image in images]
    else:
        poses = record3d_poses(path, images, reader)
    if poses is None:
        if require:
            raise no_poses(path, "poses.txt", "one line per depth image")
        return None
    if all(pose is None for pose in poses):
        raise InputError(f"no pose of {reader.source} is finite; was tracking lost throughout?")
    ordered = not (file.is_file() and read_text(file).startswith(UNORDERED))
    return FolderPoses(poses, reader.notes, ordered)


def no_poses(path: Path, file: str, content: str) -> InputError:
    """The error that a sequence has no poses."""
    return InputError(
        f"{path} has no camera poses: expected {file} with {content}; add it, or track the camera "
        "(run=label run.estimate_poses=true)"
    )


def require_times(
    path: Path, times: NDArray[np.float64], lines: Sequence[Sequence[str]], largest_delay: float
) -> None:
    """Raises an InputError if a file that is named by a time is listed under another one.

    Names may be of another clock, a constant apart from the times of the lines.
    """
    stems = [Path(words[0]).stem for words in lines]
    if not all(_TIME.fullmatch(stem) for stem in stems):
        return
    offsets = np.array([float(stem) for stem in stems]) - times
    wrong = np.flatnonzero(np.abs(offsets - np.median(offsets)) > largest_delay)
    if wrong.size:
        first = int(wrong[0])
        raise InputError(
            f"{path} lists {lines[first][0]} under time {times[first]:.6f}: {wrong.size} of "
            f"{len(lines)} files are not named by the times of their lines; put each file's own "
            "time before it"
        )


def _listed(file: Path, images: Sequence[Path], reader: PoseReader) -> Poses:
    lines = read_numbers(file)
    if any(len(words) in _NAMED for words in lines):
        return _named(file, lines, images, reader)
    names = [image.stem for image in images] + [""] * len(lines)
    poses = [
        reader.read(words, name, f"line {number} of {file}")
        for number, (words, name) in enumerate(zip(lines, names, strict=False), start=1)
    ]
    if len(poses) != len(images):
        raise InputError(
            f"{file} holds {len(poses)} poses, but {images[0].parent} {len(images)} images; give "
            "one pose per depth image, in the order of their names (2 before 10), or begin each "
            "line with the name of its image"
        )
    return poses


def _named(
    file: Path, lines: Sequence[Sequence[str]], images: Sequence[Path], reader: PoseReader
) -> Poses:
    """Poses of lines that begin with names of images; lines of other images are left out."""
    words_by_key: dict[str, Sequence[str]] = {}
    for number, words in enumerate(lines, start=1):
        if len(words) not in _NAMED:
            raise InputError(
                f"line {number} of {file} holds {len(words)} words, but others begin with the name "
                "of an image; give a name in each line or in none"
            )
        if words_by_key.setdefault(_key(words[0]), words) is not words:
            raise InputError(f"{file} has two poses of image {words[0]}; keep one")
    missing_images = [image for image in images if _key(image.name) not in words_by_key]
    if missing_images:
        raise InputError(
            f"{file} has no pose for {missing_images[0]} ({len(missing_images)} of {len(images)} "
            "images have none); begin each line with the name of its image, or leave names out and "
            "give one line per image in their order (2 before 10)"
        )
    return [
        reader.read(
            words_by_key[_key(image.name)][1:], image.stem, f"the line of {image.stem} in {file}"
        )
        for image in images
    ]


def _image_pose(folder: Path, image: Path, reader: PoseReader) -> NDArray[np.float64] | None:
    """The pose in the file that is named as an image."""
    file = folder / f"{image.stem}.txt"
    if not file.is_file():
        raise InputError(f"no pose {file} beside {image}; add it, with the name of the depth image")
    return reader.read(
        [word for words in read_numbers(file) for word in words], image.stem, str(file)
    )


def _key(name: str) -> str:
    """A name as names are compared: depth/7.png is 7, and 000007 is as well."""
    stem = re.sub(r"\.(png|npy|exr|jpe?g)$", "", name.rpartition("/")[2], flags=re.IGNORECASE)
    integer, point, fraction = stem.partition(".")
    if not integer.isdigit() or (point and not fraction.isdigit()):
        return stem
    return f"{integer.lstrip('0')}.{fraction.rstrip('0')}"
