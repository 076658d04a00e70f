"""A scene of things as pure data, and many of them in one file of numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import StorageError
from scenefw.core.files import DAMAGED, replacing, unreadable
from scenefw.core.types import Pose
from scenefw_things.shapes.families import FAMILIES, OBSTACLES
from scenefw_things.shapes.thing import Thing

BACKGROUND, SUPPORT, OBSTACLE, OBJECT = range(4)
"""Classes of pixels: nothing or the floor; what things lie on or in; what is no thing; things."""

_MAX_PARAMETERS = 8  # of a family


@dataclass(frozen=True)
class ThingItem:
    """A thing, or what is none, in a scene.

    Args:
        thing: what.
        pose: where; its frame to the world's, in which z = 0 is the top of the table.
        role: SUPPORT, OBSTACLE or OBJECT.
        paint: seed of its looks.
    """

    thing: Thing
    pose: Pose
    role: int
    paint: int


@dataclass(frozen=True)
class ThingScene:
    """Things at rest; equal scenes look equal.

    Args:
        items: in the order of their labels, from 1 on.
        floor: height of the floor, 0 or less (m); at 0 it is the table, without an end.
        light: seed of lamps and of the floor's look.
        index: number of the scene, with the seed its identity.
        seed: of the data set.
        split: part of the data set.
    """

    items: tuple[ThingItem, ...]
    floor: float
    light: int
    index: int
    seed: int
    split: str

    @property
    def roles(self) -> NDArray[np.int64]:
        """Class (N + 1,) of each label; label 0 is the background, or the table without an end."""
        ground = SUPPORT if self.floor == 0 else BACKGROUND
        return np.array([ground, *(item.role for item in self.items)])


def save_scenes(path: Path | str, scenes: Sequence[ThingScene]) -> Path:
    """Writes scenes as one compressed file: families, parameters, seeds and poses.

    Raises:
        StorageError: the folder can't be written.
    """
    items = [item for scene in scenes for item in scene.items]
    parameters = np.full((len(items), _MAX_PARAMETERS), np.nan, dtype=np.float32)
    for row, item in zip(parameters, items, strict=True):
        row[: len(item.thing.parameters)] = item.thing.parameters
    arrays: dict[str, Any] = {
        "family": np.array([item.thing.family for item in items], dtype=np.str_),
        "parameters": parameters,
        "seeds": np.array([(item.thing.seed, item.paint) for item in items], dtype=np.int64),
        "positions": np.array([item.pose.position for item in items]).reshape(-1, 3),
        "quaternions": np.array([item.pose.quaternion for item in items]).reshape(-1, 4),
        "roles": np.array([item.role for item in items], dtype=np.uint8),
        "counts": np.array([len(scene.items) for scene in scenes], dtype=np.int64),
        "floors": np.array([scene.floor for scene in scenes], dtype=np.float64),
        "numbers": np.array([(s.light, s.index, s.seed) for s in scenes], np.int64).reshape(-1, 3),
        "splits": np.array([scene.split for scene in scenes], dtype=np.str_),
    }
    path = Path(path)
    with replacing(path) as temporary:
        np.savez_compressed(temporary, **arrays)
    return path


def load_scenes(path: Path | str) -> list[ThingScene]:
    """Reads scenes.

    Raises:
        StorageError: the file is missing, damaged or holds no scenes of things.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        ends = np.cumsum(data["counts"])
        items = [_item(data, row) for row in range(len(data["family"]))]
        return [_scene(data, row, items[end - count : end])
                for row, (end, count) in enumerate(zip(ends.tolist(), data["counts"].tolist(),
                                                       strict=True))]  # fmt: skip
    except FileNotFoundError as error:
        raise StorageError(f"no scenes at {path}; make them with run=generate_things") from error
    except KeyError as error:
        raise StorageError(f"{path} holds no scenes of things: {error.args[0]}") from error
    except (*DAMAGED, TypeError) as error:
        raise StorageError(
            f"{path} is damaged or not an .npz file ({unreadable(error)}); regenerate it with "
            "run=generate_things"
        ) from error


def _scene(data: dict[str, NDArray[Any]], row: int, items: Sequence[ThingItem]) -> ThingScene:
    light, index, seed = data["numbers"][row].tolist()
    floor, split = float(data["floors"][row]), str(data["splits"][row])
    return ThingScene(tuple(items), floor, light, index, seed, split)


def _item(data: dict[str, NDArray[Any]], row: int) -> ThingItem:
    name = str(data["family"][row])
    count = len((FAMILIES | OBSTACLES)[name].limits)
    seed, paint = data["seeds"][row].tolist()
    thing = Thing(name, tuple(data["parameters"][row, :count].tolist()), seed)
    pose = Pose(data["positions"][row], data["quaternions"][row])
    return ThingItem(thing, pose, int(data["roles"][row]), paint)
