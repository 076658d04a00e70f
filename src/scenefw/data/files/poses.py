"""Camera poses from text files, checked: one pose per line, camera to world."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.files import write_text
from scenefw.core.geometry import rigid, rotation_from_quaternion

Array = NDArray[np.float64]

UNORDERED = "# unordered views: poses may jump"
"""First line of a file of poses whose frames are not a video."""

_FARTHEST = 20.0
"""Cameras that see one table are not this far apart (m)."""

_FORMATS = "16 (4 x 4), 12 (3 x 4) or 7 (x y z qx qy qz qw) numbers per line"


def read_numbers(path: Path) -> list[list[str]]:
    """Words of each line of a text file that is neither empty nor a comment.

    Raises:
        InputError: the file is missing or no text.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot read {path}: {error}; expected a text file") from error
    words = (line.partition("#")[0].replace(",", " ").split() for line in lines)
    return [line for line in words if line]


def read_poses(path: Path) -> list[Array]:
    """`T_world_camera` (4, 4) of each line: 16, 12 or 7 numbers.

    Raises:
        InputError: the file is missing, or a line is not a pose.
    """
    return [pose_of(words, f"line {i + 1} of {path}") for i, words in enumerate(read_numbers(path))]


def write_poses(path: Path, poses: Sequence[Array], *, ordered: bool = True) -> None:
    """Writes one 4 x 4 matrix per line, row by row, atomically."""
    lines = [] if ordered else [UNORDERED]
    lines += [" ".join(f"{value:.9g}" for value in np.asarray(pose).ravel()) for pose in poses]
    write_text(path, "\n".join(lines) + "\n")


def pose_of(words: Sequence[str], where: str) -> Array:
    """A pose of 16, 12 or 7 numbers.

    Raises:
        InputError: another number of values, values that are no numbers, or no rigid motion.
    """
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise InputError(f"{where} is not a pose: {' '.join(words)}; expected {_FORMATS}") from None
    if values.size == 7:
        if not np.linalg.norm(values[3:]) > 1e-6:
            raise InputError(f"{where} has no rotation: its quaternion is {values[3:].tolist()}")
        x, y, z, w = values[3:]
        return rigid(rotation_from_quaternion((w, x, y, z)), values[:3])
    if values.size not in (12, 16):
        raise InputError(f"{where} holds {values.size} numbers; expected {_FORMATS}")
    matrix = np.eye(4)
    matrix[:3] = values[:12].reshape(3, 4)
    rotation = matrix[:3, :3]
    if not np.isfinite(matrix).all() or not np.allclose(
        rotation @ rotation.T, np.eye(3), atol=1e-3
    ):
        raise InputError(f"{where} is not a rigid motion; expected a rotation and metres, no scale")
    if np.linalg.det(rotation) < 0:
        raise InputError(
            f"{where} is a mirror image (determinant -1), not a rotation; was an axis turned "
            "around, as between OpenGL and OpenCV? turn two of them"
        )
    return matrix


def require_metres(poses: Sequence[Array], where: str) -> None:
    """Raises an InputError if the camera is so far from its first place that the unit is wrong."""
    positions = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
    distances = np.linalg.norm(positions - positions[:1], axis=1)
    if distances.max(initial=0) > _FARTHEST:
        raise InputError(
            f"the poses of {where} are up to {distances.max():.0f} m from the first: millimetres "
            "given as metres, or tracking was lost? give positions in metres, of one table"
        )


def require_smooth(poses: Sequence[Array], largest_jump: float, where: str) -> None:
    """Raises an InputError if the camera moves farther than `largest_jump` (m) between frames."""
    positions = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    jumps = np.flatnonzero(steps > largest_jump)
    if jumps.size:
        first = int(jumps[0])
        raise InputError(
            f"the poses of {where} jump {jumps.size} time(s), first by {steps[first]:.2f} m from "
            f"frame {first} to {first + 1}, at most {largest_jump} m expected; tracking was lost? "
            "cut the sequence there, or give run.largest_jump=null if the frames are not a video"
        )
