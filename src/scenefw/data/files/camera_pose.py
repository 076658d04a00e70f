"""The pose of a camera in a robot's base, as settings, files and arrays give it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.data.files.poses import pose_of, read_numbers
from scenefw.data.files.structured import read_structured

_KEYS = ("T_base_camera", "T_robot_camera", "camera_pose", "pose", "transform")
_EXPECTED = (
    "give a 4 x 4 or 3 x 4 matrix, or x y z qx qy qz qw, that takes camera coordinates (x right, "
    "y down, z forward) to the base"
)

CameraPose = str | Path | Sequence[float] | NDArray[np.float64] | None
"""Whatever holds the pose: see `camera_pose_of`."""


def camera_pose_of(pose: CameraPose, name: str = "camera_pose") -> NDArray[np.float64] | None:
    """`T_base_camera` (4, 4), camera (OpenCV) to base; None if none is given.

    Args:
        pose: numbers, (4, 4), (3, 4) or x y z qx qy qz qw; or a file of them: text, or JSON or YAML
            with one of the keys `T_base_camera` or `camera_pose`, or `translation` and `rotation`
            with x, y, z, w as ROS names them.
        name: of the setting or field, for messages.

    Raises:
        InputError: the file is missing, or this is no pose.
    """
    if pose is None:
        return None
    if isinstance(pose, str | Path):
        path = Path(pose).expanduser()
        if not path.is_file():
            raise InputError(f"{name} = {pose}: no such file; {_EXPECTED}")
        name = path.name
        pose = _content(path)
    try:
        numbers = np.asarray(pose, dtype=np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} holds no numbers; {_EXPECTED}") from error
    if numbers.size not in (7, 12, 16):
        raise InputError(f"{name} has {numbers.size} numbers; {_EXPECTED}")
    return pose_of([repr(float(number)) for number in numbers], name)


def _content(path: Path) -> Any:
    if path.suffix.lower() not in (".json", ".yaml", ".yml"):
        return [word for line in read_numbers(path) for word in line]
    content = read_structured(path)
    if isinstance(content, Mapping):
        key = next((key for key in _KEYS if key in content), None)
        content = content if key is None else content[key]
    if isinstance(content, Mapping):
        return _transform(content, path)
    return content


def _transform(content: Mapping[str, Any], path: Path) -> list[float]:
    """Numbers x y z qx qy qz qw of a transform or a pose of ROS."""
    place = content.get("translation", content.get("position"))
    turn = content.get("rotation", content.get("orientation"))
    try:
        return [float(place[axis]) for axis in "xyz"] + [float(turn[axis]) for axis in "xyzw"]
    except (TypeError, KeyError, ValueError, IndexError) as error:
        raise InputError(f"{path} holds no pose; {_EXPECTED}") from error
