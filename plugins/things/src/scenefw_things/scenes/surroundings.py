"""Tables, and what stands about and is no thing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenefw.core.geometry import quaternion_from_rotation
from scenefw.core.settings import SHARE
from scenefw.core.types import Float64, Pose
from scenefw_things.scenes.arrangements import box_about
from scenefw_things.scenes.scene import OBSTACLE, SUPPORT, ThingItem
from scenefw_things.shapes.families import OBSTACLES
from scenefw_things.shapes.solids import rotation
from scenefw_things.shapes.thing import Thing

_FLOORS = (-1.0, -0.35)  # m: of floors below tables
_STANDING = ("shelf", "crate", "monitor", "robot_arm")
_HANGING = ("forearm", "robot_gripper")
_CLEAR = 0.01  # m: between boxes of obstacles' parts and of things


class Surroundings:
    """Draws a table, with edges or without an end, and obstacles that touch nothing.

    Args:
        edges: share of tables with edges, above a floor.
        second: share of those with a second table, lower down.
        walls: share of scenes with a wall behind.
        standing: share of scenes with a shelf, a crate, a monitor or a robot beside the things.
        hanging: share of scenes with a forearm or a gripper that reaches over them.

    Raises:
        ConfigError: a share that is none.
    """

    def __init__(
        self,
        edges: float = 0.5,
        second: float = 0.25,
        walls: float = 0.35,
        standing: float = 0.35,
        hanging: float = 0.3,
    ) -> None:
        SHARE.require(edges=edges, second=second, walls=walls, standing=standing, hanging=hanging)
        self.edges, self.second, self.walls = edges, second, walls
        self.standing, self.hanging = standing, hanging

    def table(self, rng: np.random.Generator) -> tuple[float, list[ThingItem]]:
        """Height of the floor (m), and tables above it; none if the floor is the table."""
        if rng.random() >= self.edges:
            return 0.0, []
        floor = float(rng.uniform(*_FLOORS))
        top = _drawn("table_top", rng)
        yaw = rotation(2, rng.uniform(0, 2 * np.pi))
        place = yaw @ np.array([*rng.uniform(-0.12, 0.12, 2), -top.parameters[2]])
        items = [_item(top, place, yaw, SUPPORT, rng)]
        if rng.random() < self.second:
            other = _drawn("table_top", rng)
            side = (top.parameters[0] + other.parameters[0]) / 2 + rng.uniform(0.02, 0.3)
            drop = rng.uniform(0.08, min(0.5, -floor))
            at = yaw @ np.array([side * rng.choice([-1, 1]), rng.uniform(-0.3, 0.3),
                                 -drop - other.parameters[2]])  # fmt: skip
            items.append(_item(other, place * (1, 1, 0) + at, yaw, SUPPORT, rng))
        return floor, items

    def obstacles(
        self, rng: np.random.Generator, items: Sequence[ThingItem], floor: float
    ) -> list[ThingItem]:
        """What is no thing, where it is free of the items."""
        taken = [_part_boxes(item) for item in items]
        low = np.concatenate([boxes[0] for boxes in taken])
        high = np.concatenate([boxes[1] for boxes in taken])
        drawn: list[ThingItem] = []
        for share, make in ((self.walls, _wall), (self.standing, _stand), (self.hanging, _hang)):
            if rng.random() >= share:
                continue
            for _ in range(_TRIALS):
                item = make(rng, floor)
                lower, upper = _part_boxes(item)
                apart = (lower[:, None] > high + _CLEAR) | (upper[:, None] < low - _CLEAR)
                if apart.any(axis=2).all():
                    drawn.append(item)
                    low, high = np.concatenate([low, lower]), np.concatenate([high, upper])
                    break
        return drawn


_TRIALS = 8  # places for each obstacle


def _wall(rng: np.random.Generator, floor: float) -> ThingItem:
    wall = _drawn("wall_panel", rng)
    yaw = rotation(2, rng.uniform(0, 2 * np.pi))
    away = rng.uniform(0.35, 1.2)
    return _item(wall, yaw @ np.array([0, away, 0]) + (0, 0, floor), yaw, OBSTACLE, rng)


def _stand(rng: np.random.Generator, floor: float) -> ThingItem:
    del floor
    thing = _drawn(str(rng.choice(_STANDING)), rng)
    azimuth, away = rng.uniform(0, 2 * np.pi), rng.uniform(0.3, 0.7)
    at = np.array([away * np.cos(azimuth), away * np.sin(azimuth), 0.002])
    return _item(thing, at, rotation(2, azimuth + rng.normal(np.pi / 2, 0.4)), OBSTACLE, rng)


def _hang(rng: np.random.Generator, floor: float) -> ThingItem:
    del floor
    thing = _drawn(str(rng.choice(_HANGING)), rng)
    azimuth = rng.uniform(0, 2 * np.pi)
    at = np.array([*rng.uniform(-0.25, 0.25, 2), rng.uniform(0.01, 0.35)])
    turn = rotation(2, azimuth) @ rotation(1, rng.uniform(-0.1, 0.7))
    return _item(thing, at, turn @ rotation(0, rng.normal(0, 0.3)), OBSTACLE, rng)


def _part_boxes(item: ThingItem) -> tuple[Float64, Float64]:
    """Lowest and highest corners (P, 3) of boxes about the parts of an item."""
    boxes = [box_about((part,), item.pose) for part in item.thing.parts]
    return np.array([box[0] for box in boxes]), np.array([box[1] for box in boxes])


def _drawn(name: str, rng: np.random.Generator) -> Thing:
    low, high = np.array(list(OBSTACLES[name].limits.values())).T
    values = rng.uniform(low, high).astype(np.float32)
    return Thing(name, tuple(float(value) for value in values), int(rng.integers(2**31)))


def _item(
    thing: Thing, place: Float64, turn: Float64, role: int, rng: np.random.Generator
) -> ThingItem:
    pose = Pose(np.asarray(place, dtype=np.float64), quaternion_from_rotation(turn))
    return ThingItem(thing, pose, role, int(rng.integers(2**31)))
