"""Which convention the poses of a recording follow, as its depth images tell it.

Neighbouring views show the same surface. With the right poses the points of one view lie on the
depth of the next; with poses of another convention they don't.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np

from scenefw.core.errors import InputError
from scenefw.core.geometry import inverse, quaternion_from_rotation, rigid, rotation_from_quaternion
from scenefw.core.types import Float64, Frame

_Pair: TypeAlias = tuple[int, Frame, int, Frame]  # numbers and frames of two views

_GL_CAMERA = np.diag([1.0, -1.0, -1.0, 1.0])  # y up, z backward
_P3D_CAMERA = np.diag([-1.0, -1.0, 1.0, 1.0])  # x left, y up
_LEFT_HANDED = np.diag([1.0, -1.0, 1.0, 1.0])  # Unity: y up, z forward, in world and camera
_TARGET_POINTS = 5000  # of each view
_MIN_POINTS = 300  # of all pairs; fewer tell nothing
_MAX_PAIRS = 6
_MAX_CHECKED = 60  # views that are compared with their neighbours, of long recordings every few
_MAX_NAMED = 3
_MIN_MOTION, _MIN_TURN = 0.1, np.radians(10)  # m: by less, views agree whatever the convention
_TOLERANCE = 0.015  # m: noise of depth cameras at 2 m and drift of tracking between neighbours
_MIN_VOTES = 0.02  # share of the points on which two conventions differ; below, nothing tells
_MIN_MAJORITY = 5.0
"""Times as many points that another convention explains and the given one doesn't, as the other
way round. For right poses it is below 0.3, for wrong ones above 20 (two real recordings, four
simulated ones)."""
_MIN_VISIBLE = 0.5
_MAX_DEVIATION = 0.02  # m: views of a table that agree less are told, whatever the reason


class Views(Protocol):
    """A recording, such as those of `open_sequence`."""

    def __getitem__(self, index: int) -> Frame:
        """One frame."""


@dataclass(frozen=True, eq=False)
class _Reading:
    """Poses as another convention has them.

    Args:
        words: its name.
        fix: what to do, if it is right.
        poses: (4, 4) each.
    """

    words: str
    fix: str
    poses: Sequence[Float64]


def _w_first(pose: Float64) -> Float64:
    w, x, y, z = quaternion_from_rotation(pose[:3, :3])
    # the file's numbers were taken for x y z w
    return rigid(rotation_from_quaternion((x, y, z, w)), pose[:3, 3])


def _scaled(pose: Float64, unit: float) -> Float64:
    return rigid(pose[:3, :3], unit * pose[:3, 3])


_ROS_CAMERA = np.array(
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)  # x forward, y left, z up

_STEPS: Sequence[Mapping[str, tuple[str, Callable[[Float64], Float64]]]] = (
    {"quaternion_w_first": ("quaternions as w x y z", _w_first)},
    {
        "millimetres": ("positions in millimetres", lambda pose: _scaled(pose, 0.001)),
        "centimetres": ("positions in centimetres", lambda pose: _scaled(pose, 0.01)),
    },
    {"world_to_camera": ("poses from world to camera", inverse)},
    {
        "opengl": ("camera axes of OpenGL, ARKit or Blender", lambda pose: pose @ _GL_CAMERA),
        "ros": ("camera axes of ROS bodies (x forward)", lambda pose: pose @ _ROS_CAMERA),
        "pytorch3d": ("camera axes of PyTorch3D (x left, y up)", lambda pose: pose @ _P3D_CAMERA),
    },
)
"""By the words of the setting, in the order in which they are undone: what they say, and how a pose
(4, 4) comes nearer to camera to world in OpenCV's axes."""

CONVENTIONS = {name: phrase for step in _STEPS for name, (phrase, _) in step.items()}
"""What a word of the setting says of poses."""

OPENCV = "opencv"
"""Camera to world, OpenCV's axes, metres: the convention without further words."""


def converted(pose: Float64, convention: str) -> Float64:
    """A pose (4, 4) of another convention, camera to world with OpenCV's axes.

    Args:
        pose: as its file has it, a quaternion being taken for x y z w.
        convention: `OPENCV`, or words joined by +, such as `world_to_camera+opengl`.

    Raises:
        InputError: there is no such convention.
    """
    words = set(str(convention).split("+")) - {OPENCV}
    if not words <= CONVENTIONS.keys() or any(len(words & step.keys()) > 1 for step in _STEPS):
        raise InputError(
            f"no pose convention {convention}; expected {OPENCV}, or of {', '.join(CONVENTIONS)} "
            "what differs from it, joined by +"
        )
    for step in _STEPS:
        for name in words & step.keys():
            pose = step[name][1](pose)
    return pose


def _conventions() -> list[tuple[str, ...]]:
    """Words of all conventions, those of fewer words first."""
    choices = itertools.product(*(("", *step) for step in _STEPS))
    return sorted((tuple(filter(None, choice)) for choice in choices), key=len)


def check_conventions(
    views: Views,
    file_poses: Sequence[Float64],
    names: Sequence[str],
    source: str,
    convention: str = OPENCV,
) -> tuple[str, ...]:
    """Compares neighbouring views; returns what is odd, a line each.

    Args:
        views: depth images.
        file_poses: (4, 4) of all of them, as the file has them.
        names: of the images.
        source: the recording, for messages.
        convention: that is assumed, as `converted` takes it.

    Raises:
        InputError: another convention explains the images better than the one that was assumed.
    """
    poses = [converted(pose, convention) for pose in file_poses]
    pairs = list(_pairs(views, poses))
    if not pairs:
        return ()
    given = _residuals(pairs, poses)
    if len(given) < _MIN_POINTS:
        return ()
    best, best_votes = None, _MIN_VOTES * len(given)
    for reading in _readings(file_poses, poses, names, convention):
        residuals = _residuals(pairs, reading.poses)
        gained, lost = _votes(given, residuals)
        is_better = gained - lost > best_votes and gained > _MIN_MAJORITY * lost
        if is_better and np.median(residuals) < _MAX_DEVIATION:
            best, best_votes = (reading, residuals), gained - lost
    if best is not None:
        reading, residuals = best
        disputed = (residuals < _TOLERANCE) != (given < _TOLERANCE)
        raise InputError(
            f"the poses of {source} contradict its depth images: with {reading.words} neighbouring "
            f"views agree to {_words(np.median(residuals[disputed]))} where the two differ, as "
            f"given {_against(np.median(given[disputed]))}; {reading.fix}"
        )
    deviation = np.median(given)
    if deviation > _MAX_DEVIATION:
        finding = (
            f"neighbouring views agree to {_words(deviation)} only"
            if np.isfinite(deviation)
            else "neighbouring views don't show the same place"
        )
        return (f"{finding}; check poses, intrinsics and depth scale",)
    return _odd_poses(views, poses, names, float(deviation))


def _odd_poses(
    views: Views, poses: Sequence[Float64], names: Sequence[str], deviation: float
) -> tuple[str, ...]:
    """A line on views that contradict their neighbours, where most agree.

    Args:
        views: depth images.
        poses: (4, 4) of all of them.
        names: of the images.
        deviation: by which neighbours agree in the median (m).
    """
    limit = max(_MAX_DEVIATION, _MIN_MAJORITY * deviation)
    step = -(-len(poses) // _MAX_CHECKED)
    numbers, frames = [], []
    for number in range(0, len(poses), step):
        try:
            frames.append(views[number])
        except InputError:  # who reads it says so
            continue
        numbers.append(number)
    contradicts = [False]
    for pair in itertools.pairwise(zip(numbers, frames, strict=True)):
        residuals = _residuals([(*pair[0], *pair[1])], poses)
        overlap = residuals[np.isfinite(residuals)]
        contradicts.append(len(overlap) > _MIN_POINTS and float(np.median(overlap)) > limit)
    contradicts.append(False)
    odd = [  # both neighbours of one whose pose is wrong differ from it
        names[number]
        for number, before, after in zip(numbers, contradicts, contradicts[1:], strict=False)
        if before and after
    ]
    if not odd:
        return ()
    suffix = " and others" * (len(odd) > _MAX_NAMED)
    return (
        f"depth of {', '.join(odd[:_MAX_NAMED])}{suffix} contradicts the views before and after; "
        "check these poses, or leave the images out",
    )


def _votes(given: Float64, residuals: Float64) -> tuple[int, int]:
    """Points that another reading explains and the given one doesn't, and the other way round.

    Where both put most points in view of the neighbour, those that leave it tell nothing.
    """
    visible = np.isfinite(given) & np.isfinite(residuals)
    if visible.mean() < _MIN_VISIBLE:
        visible[:] = True
    explained, was_explained = residuals[visible] < _TOLERANCE, given[visible] < _TOLERANCE
    return int((explained & ~was_explained).sum()), int((was_explained & ~explained).sum())


def _words(deviation: np.floating[Any]) -> str:
    return f"{max(deviation * 1000, 1):.0f} mm"


def _against(deviation: np.floating[Any]) -> str:
    return f"to {_words(deviation)}" if np.isfinite(deviation) else "they don't see the same place"


def _readings(
    file_poses: Sequence[Float64], poses: Sequence[Float64], names: Sequence[str], assumed: str
) -> Iterator[_Reading]:
    """Other conventions and, with the assumed one, other orders of the poses."""
    for words in _conventions():
        convention = "+".join(words) or OPENCV
        if set(convention.split("+")) == set(assumed.split("+")):
            continue
        readings = [converted(pose, convention) for pose in file_poses]
        if _spread(readings) < _MIN_MOTION < _spread(poses):  # all in one place, views can't differ
            continue
        phrase = " and ".join(CONVENTIONS[word] for word in words) or "poses as documented"
        yield _Reading(phrase, f"set run.poses={convention}", readings)
    transposed = [rigid(pose[:3, :3].T, pose[:3, 3]) for pose in poses]
    yield _Reading("transposed rotations", "transpose the 3 x 3 part of each pose", transposed)
    mirrored = [_LEFT_HANDED @ pose @ _LEFT_HANDED for pose in poses]
    left_handed = "left-handed axes (y up, of Unity)"
    yield _Reading(left_handed, "negate the second row and column of each pose", mirrored)
    numbered = "begin each line of the poses with its image's name, or, in TUM's, shift the times"
    yield _Reading("each pose one image later", numbered, [poses[0], *poses[:-1]])
    yield _Reading("each pose one image earlier", numbered, [*poses[1:], poses[-1]])
    yield _Reading("poses in the reverse order", numbered, poses[::-1])
    by_text = sorted(range(len(names)), key=names.__getitem__)
    if by_text != list(range(len(names))):
        placed = dict(zip(by_text, poses, strict=True))
        phrase = "poses in the order of the images' names as text (10 before 2)"
        yield _Reading(phrase, numbered, [placed[number] for number in range(len(names))])


def _spread(poses: Sequence[Float64]) -> float:
    """Largest distance (m) of a camera from the first."""
    positions = np.array([pose[:3, 3] for pose in poses])
    return float(np.linalg.norm(positions - positions[0], axis=1).max())


def _pairs(views: Views, poses: Sequence[Float64]) -> Iterator[_Pair]:
    """Neighbouring views between which the camera moved, spread over the recording."""
    if len(poses) < 2:
        return
    for first in np.unique(np.linspace(0, len(poses) - 2, _MAX_PAIRS).astype(int)):
        second = next(
            (n for n in range(first + 1, len(poses)) if _has_moved(poses[first], poses[n])),
            len(poses) - 1,
        )
        try:
            yield int(first), views[int(first)], second, views[second]
        except InputError:  # who reads it says so
            continue


def _has_moved(first: Float64, second: Float64) -> bool:
    motion = inverse(first) @ second
    turn = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1) / 2, -1, 1))
    return bool(np.linalg.norm(motion[:3, 3]) > _MIN_MOTION or turn > _MIN_TURN)


def _residuals(pairs: Sequence[_Pair], poses: Sequence[Float64]) -> Float64:
    """Distances (m) along rays between points of views and the depth of their neighbours.

    Infinite where a neighbour doesn't see the point.
    """
    return np.concatenate(
        [
            _pair_residuals(first, second, inverse(poses[j]) @ poses[i])
            for i, first, j, second in pairs
        ]
    )


def _pair_residuals(first: Frame, second: Frame, motion: Float64) -> Float64:
    stride = max(round((first.depth.size / _TARGET_POINTS) ** 0.5), 1)
    v, u = np.mgrid[: first.depth.shape[0] : stride, : first.depth.shape[1] : stride]
    depth = first.depth[::stride, ::stride].astype(np.float64)
    measured = depth > 0
    camera, depth = first.camera, depth[measured]
    rays = np.stack(
        [
            (u[measured] - camera.cx) / camera.fx,
            (v[measured] - camera.cy) / camera.fy,
            0 * depth + 1,
        ]
    )
    x, y, z = motion[:3, :3] @ (rays * depth) + motion[:3, 3:]
    camera = second.camera
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        columns, rows = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    inside = (z > 0) & (columns > -0.5) & (columns < camera.width - 0.5)
    inside &= (rows > -0.5) & (rows < camera.height - 0.5)
    residuals = np.full(len(depth), np.inf)
    at = np.rint(rows[inside]).astype(int), np.rint(columns[inside]).astype(int)
    other = second.depth[at]
    residuals[inside] = np.where(other > 0, np.abs(z[inside] - other), np.inf)
    return residuals
