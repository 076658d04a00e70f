"""A floor that is known beforehand, as under a camera that doesn't move."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import utf8_text
from scenefw.core.floors import Floor
from scenefw.core.settings import POSITIVE, SHARE
from scenefw.data.files.poses import MAX_ROTATION_ERROR
from scenefw.perception.observation.floor import near_plane, points_within

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Float64, Frame


class KnownFloor:
    """The same floor in every frame: of a camera that is calibrated to its table, and stands still.

    It works where objects hide most of the table, and keeps the frame of objects from one image to
    the next. A few points on the floor are enough; with fewer, the camera has probably moved.

    Args:
        normal: (3,) of the floor, up, in camera coordinates (x right, y down, z forward).
        height: of the camera above the floor (m).
        scene: `scene.json` of an earlier prediction, whose floor it is; instead of both.
        inlier_distance: points this close to the floor lie on it at 1 m; grows with depth squared
            (m).
        max_depth: points farther away don't count (m).
        min_inlier_ratio: of the points within reach that must lie on the floor.

    Raises:
        ConfigError: neither a plane nor a scene or both, a normal that isn't one, a height or
            length that isn't positive.
        InputError: the scene can't be read, or has no floor.
    """

    def __init__(
        self,
        normal: Sequence[float] | None = None,
        height: float | None = None,
        scene: str | None = None,
        inlier_distance: float = 0.008,
        max_depth: float = 2.0,
        min_inlier_ratio: float = 0.05,
    ) -> None:
        if scene is not None and normal is None and height is None:
            normal, height = _floor_of_scene(Path(scene))
        elif scene is not None or normal is None or height is None:
            raise ConfigError(
                "give floor.normal and floor.height, or floor.scene=.../scene.json, whose floor "
                "it is"
            )
        elif not _is_up(normal):
            raise ConfigError(f"floor.normal is {normal}; expected the 3 numbers of a unit vector")
        POSITIVE.require(inlier_distance=inlier_distance, max_depth=max_depth)
        SHARE.require(min_inlier_ratio=min_inlier_ratio)
        self.inlier_distance, self.max_depth, self.min_inlier_ratio = (
            inlier_distance,
            max_depth,
            min_inlier_ratio,
        )
        POSITIVE.require(height=height)
        vector = np.asarray(normal, np.float64)
        self.normal: Float64 = vector / np.linalg.norm(vector)
        self.height = float(height)

    def find(self, frame: Frame) -> Floor:
        """The floor, with how well the points of a frame that are near it lie on it.

        Raises:
            InputError: too few points within reach, or too few of them on the floor.
        """
        points = points_within(frame, self.max_depth)
        distance = points @ self.normal + self.height
        inliers = near_plane(points, distance, self.inlier_distance)
        share = float(inliers.mean())
        if share < self.min_inlier_ratio:
            raise InputError(
                f"{frame.name}: {share:.0%} of the points lie on the known floor, "
                f"{self.min_inlier_ratio:.0%} are needed; has the camera moved? Give its floor "
                "again, or take floor=ransac"
            )
        mean_square = np.square(distance[inliers]).mean() if inliers.any() else 0.0
        return Floor(self.normal, self.height, share, float(np.sqrt(mean_square)))


def _is_up(normal: Any) -> bool:
    """Whether these are the three numbers of a unit vector, perhaps typed by hand."""
    try:
        vector = np.asarray(normal, np.float64)
    except (TypeError, ValueError):
        return False
    return vector.shape == (3,) and bool(abs(np.linalg.norm(vector) - 1) <= MAX_ROTATION_ERROR)


def _floor_of_scene(path: Path) -> tuple[Any, float]:
    """Normal and height of the floor in a `scene.json`."""
    try:
        floor = json.loads(utf8_text(path))["floor"]
        normal, height = floor["normal"], float(floor["height"])
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise _no_floor_in(path, error) from error
    if not _is_up(normal) or not height > 0:
        raise _no_floor_in(path, f"its normal is {normal}, its height {height}")
    return normal, height


def _no_floor_in(path: Path, reason: object) -> InputError:
    return InputError(
        f"no floor in {path}; give the scene.json of an earlier run=predict ({reason})"
    )
