"""Camera poses from text files, checked: one pose per line, camera to world."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.files import write_text
from scenefw.core.geometry import rigid, rotation_from_quaternion
from scenefw.data.files.structured import read_text

Array = NDArray[np.float64]

UNORDERED = "# unordered views: poses may jump"
"""First line of a file of poses whose frames are not a video."""

MAX_CAMERA_DISTANCE = 20.0
"""Cameras that see one table are not this far apart (m)."""

MAX_ROTATION_ERROR = 0.01
"""Of R R^T: published poses are off by up to 4e-4; 0.01 is a scale of half a percent."""

_MAX_ROUNDING = 1e-5
"""Of R R^T: what six digits leave."""

_FORMATS = "16 (4 x 4), 12 (3 x 4) or 7 (x y z qx qy qz qw) numbers per line"


def read_numbers(path: Path) -> list[list[str]]:
    """Words of each line of a text file that is neither empty nor a comment.

    Raises:
        InputError: the file is missing or no text.
    """
    words = (
        line.partition("#")[0].replace(",", " ").split() for line in read_text(path).splitlines()
    )
    return [line for line in words if line]


def write_poses(path: Path, poses: Sequence[Array], *, ordered: bool = True) -> None:
    """Writes one 4 x 4 matrix per line, row by row, atomically."""
    lines = [] if ordered else [UNORDERED]
    lines += [" ".join(f"{value:.9g}" for value in np.asarray(pose).ravel()) for pose in poses]
    write_text(path, "\n".join(lines) + "\n")


def pose_of(words: Sequence[str], where: str) -> Array:
    """A pose of 16, 12 or 7 numbers; its rotation is made orthonormal.

    Raises:
        InputError: another number of values, values that are no numbers, or no rigid motion.
    """
    return _pose(words, where)[0]


class PoseReader:
    """Reads poses and remembers what was odd about them.

    Args:
        source: file or folder, for notes.
    """

    def __init__(self, source: Path) -> None:
        self.source = source
        self.lost: list[str] = []
        self.max_error = 0.0

    def read(self, words: Sequence[str], frame: str, where: str) -> Array | None:
        """A pose as `pose_of` gives it; None if it is infinite or NaN, as where tracking was lost.

        Raises:
            InputError: as `pose_of`.
        """
        if all(_is_not_finite(word) for word in words):
            self.lost.append(frame)
            return None
        pose, error = _pose(words, where)
        self.max_error = max(self.max_error, error)
        return pose

    @property
    def notes(self) -> tuple[str, ...]:
        """What the poses left open, a line each."""
        notes = []
        if self.lost:
            notes.append(
                f"frames without a pose, as tracking was lost, are left out: {', '.join(self.lost)}"
            )
        if self.max_error > _MAX_ROUNDING:
            notes.append(
                f"rotations of the poses in {self.source.name} are orthonormal to "
                f"{self.max_error:.0e} only, and were made so"
            )
        return tuple(notes)


def _is_not_finite(word: str) -> bool:
    try:
        return not math.isfinite(float(word))
    except ValueError:
        return False


def _pose(words: Sequence[str], where: str) -> tuple[Array, float]:
    """A pose, and by how much its rotation was off."""
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        raise InputError(f"{where} is not a pose: {' '.join(words)}; expected {_FORMATS}") from None
    if values.size not in (7, 12, 16):
        raise InputError(f"{where} holds {values.size} numbers; expected {_FORMATS}")
    if not np.isfinite(values).all():
        raise InputError(f"{where} holds {' '.join(words)}; expected {_FORMATS}, all finite")
    if values.size == 7:
        length = float(np.linalg.norm(values[3:]))
        if not abs(length - 1) < MAX_ROTATION_ERROR:
            raise InputError(
                f"{where} has no rotation: its quaternion {values[3:].tolist()} has the length "
                f"{length:.3g}, not 1; expected x y z qx qy qz qw"
            )
        x, y, z, w = values[3:]
        return rigid(rotation_from_quaternion((w, x, y, z)), values[:3]), 0.0
    matrix = np.eye(4)
    matrix[: values.size // 4] = values.reshape(-1, 4)
    if not np.allclose(matrix[3], (0, 0, 0, 1), atol=MAX_ROTATION_ERROR):
        matrix = _row_by_row(matrix, where)
    rotation = matrix[:3, :3]
    error = float(np.abs(rotation @ rotation.T - np.eye(3)).max())
    if error > MAX_ROTATION_ERROR:
        raise InputError(f"{where} is not a rigid motion; expected a rotation and metres, no scale")
    if np.linalg.det(rotation) < 0:
        raise InputError(
            f"{where} is a mirror image (determinant -1), not a rotation; was an axis turned "
            "around, as between OpenGL and OpenCV? turn two of them"
        )
    left, _, right = np.linalg.svd(rotation)
    return rigid(left @ right, matrix[:3, 3]), error


def _row_by_row(matrix: Array, where: str) -> Array:
    """A pose (4, 4) that was written column by column, as its last column tells."""
    if np.allclose(matrix[:, 3], (0, 0, 0, 1), atol=MAX_ROTATION_ERROR):
        return matrix.T
    raise InputError(
        f"{where} has {matrix[3].tolist()} as its last row, not 0 0 0 1; expected {_FORMATS}"
    )


def require_metres(poses: Sequence[Array], where: str) -> None:
    """Raises an InputError if the camera is so far from its first place that the unit is wrong."""
    positions = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
    distances = np.linalg.norm(positions - positions[:1], axis=1)
    if distances.max(initial=0) > MAX_CAMERA_DISTANCE:
        raise InputError(
            f"the poses of {where} are up to {distances.max():.0f} m from the first: millimetres "
            "given as metres, or tracking was lost? give positions in metres, of one table"
        )


def require_smooth(
    poses: Sequence[Array], largest_jump: float, where: str, numbers: Sequence[int] | None = None
) -> None:
    """Raises an InputError if the camera moves farther than `largest_jump` (m) between frames.

    Args:
        poses: (4, 4) each.
        largest_jump: m from a frame to the next.
        where: the recording, for the message.
        numbers: of the frames; None = there are no gaps.
    """
    positions = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    frames = np.arange(len(poses)) if numbers is None else np.asarray(numbers)
    jumps = np.flatnonzero(steps > largest_jump * np.diff(frames))
    if jumps.size:
        first = int(jumps[0])
        raise InputError(
            f"the poses of {where} jump {jumps.size} time(s), first by {steps[first]:.2f} m from "
            f"frame {frames[first]} to {frames[first + 1]}, at most {largest_jump} m expected; "
            "tracking was lost? cut the sequence there, or give run.largest_jump=null if the "
            "frames are not a video"
        )
