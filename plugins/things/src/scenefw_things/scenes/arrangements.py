"""Where things are before they fall: in piles, in rows without a gap, nested, leaning, in trays."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from scenefw.core.geometry import quaternion_from_rotation, random_quaternion
from scenefw.core.types import Float64, Pose
from scenefw_things.shapes.library import ThingLibrary
from scenefw_things.shapes.solids import Part, rotation
from scenefw_things.shapes.thing import Thing

_GAP = 0.002  # m: between boxes about things before they fall
_DROPPED = 0.015  # m: above what lies below, so that piles are not built by hand
_LEAN = (0.25, 0.7)  # rad from the vertical
_FILL = 0.8  # of an opening's half width, that what is put into it may have


@dataclass
class Placement:
    """A thing where it starts.

    Args:
        thing: what.
        pose: where.
        fixed: it holds others and stays: a tray, a bin.
        low: lowest corner of the box about it (m).
        high: highest corner.
    """

    thing: Thing
    pose: Pose
    fixed: bool = False
    low: Float64 = field(init=False)
    high: Float64 = field(init=False)

    def __post_init__(self) -> None:
        self.low, self.high = box_about(self.thing.parts, self.pose)


def box_about(parts: tuple[Part, ...], pose: Pose) -> tuple[Float64, Float64]:
    """Lowest and highest corner of a posed thing (m)."""
    corners = np.concatenate([part.corners for part in parts]) @ pose.rotation.T + pose.position
    return corners.min(axis=0), corners.max(axis=0)


class Arranger:
    """Puts groups of things about places on a table.

    Args:
        library: where things come from.
        split: part of the data.
        rng: random.
    """

    def __init__(self, library: ThingLibrary, split: str, rng: np.random.Generator) -> None:
        self.library, self.split, self.rng = library, split, rng
        self.placements: list[Placement] = []

    def pile(self, place: Float64, count: int, spread: float = 0.09) -> None:
        """Things in any attitude, each above those below it."""
        for _ in range(count):
            self._drop(self._thing(), place + self.rng.uniform(-spread, spread, 2), turned=True)

    def scatter(self, place: Float64, count: int, spread: float = 0.25) -> None:
        """Things as they usually stand or lie, apart or on each other."""
        for _ in range(count):
            self._drop(self._thing(), place + self.rng.uniform(-spread, spread, 2))

    def row(self, place: Float64, count: int) -> None:
        """Things side by side, each against the one before, in a random direction."""
        azimuth = self.rng.uniform(0, 2 * np.pi)
        grid = rotation(2, azimuth)
        edge = None
        for _ in range(count):
            thing = self._thing()
            turn = grid @ rotation(2, int(self.rng.integers(4)) * np.pi / 2)
            corners = np.concatenate([part.corners for part in thing.parts]) @ turn.T @ grid
            low, high = corners.min(axis=0), corners.max(axis=0)
            start = -(high - low)[0] / 2 if edge is None else edge
            edge = start + (high - low)[0]
            if edge > _MAX_ROW:
                return
            aside = self.rng.normal(0, 0.008) - (low + high)[1] / 2
            at = grid @ np.array([start - low[0], aside, 0.0]) + [*place, 0.0]
            self._put(thing, at, turn)

    def nest(self, place: Float64) -> None:
        """Something small or slender in a cup, a bowl or another hollow thing."""
        names = list(self.library.hollow(self.split))
        if not names:
            self.pile(place, 2)
            return
        holder = self._thing(names)
        self._put(holder, np.array([*place, 0.0]), rotation(2, self.rng.uniform(0, 2 * np.pi)))
        width = _FILL * _opening(holder)
        for _ in range(int(self.rng.integers(1, 4))):
            slender = self.library.slender(self.split) if self.rng.random() < 0.5 else ()
            thing = self._thing(slender) if slender else self._thing()
            low, high = box_about(thing.parts, _still())
            size = np.sort(high - low)
            if size[1] < width:  # on end, its longest side up
                axis = int(np.argmax(high - low))
                turn = rotation(2, self.rng.uniform(0, 2 * np.pi)) @ (
                    np.eye(3) if axis == 2 else rotation(1 - axis, np.pi / 2)
                )
                self._drop(thing, place, turn=turn @ rotation(0, self.rng.normal(0, 0.05)))

    def lean(self, place: Float64) -> None:
        """Something that leans on something that stands."""
        support = self._thing()
        yaw = rotation(2, self.rng.uniform(0, 2 * np.pi))
        self._put(support, np.array([*place, 0.0]), yaw)
        edge = (yaw.T @ (np.concatenate([p.corners for p in support.parts]) @ yaw.T).T)[0].max()
        slender = self.library.slender(self.split)
        thing = self._thing(slender) if slender else self._thing()
        low, high = box_about(thing.parts, _still())
        upright = (
            np.eye(3)
            if np.argmax(high - low) == 2
            else (rotation(1, np.pi / 2) if np.argmax(high - low) == 0 else rotation(0, np.pi / 2))
        )
        turn = yaw @ rotation(1, -self.rng.uniform(*_LEAN)) @ upright
        corners = np.concatenate([part.corners for part in thing.parts]) @ turn.T @ yaw
        start = edge - corners[:, 0].min() + _GAP
        at = yaw @ np.array([start, -corners[:, 1].mean(), 0.0])
        self._put(thing, at + [*place, _GAP - corners[:, 2].min()], turn)

    def fill(self, place: Float64, count: int) -> None:
        """Things in a tray or a bin, which stays where it is."""
        names = [name for name in ("tray", "open_box") if name in self.library.names(self.split)]
        name = str(self.rng.choice(names or ["tray"]))
        holder = self.library.thing_of(name, self.rng, self.split)
        pose = Pose(np.array([*place, 0.0]), _quaternion(rotation(2, self.rng.uniform(0, 7))))
        self.placements.append(Placement(holder, pose, fixed=True))
        self.pile(place, count, 0.25 * _opening(holder))

    def _thing(self, names: tuple[str, ...] | list[str] = ()) -> Thing:
        if not names:
            return self.library.thing(self.rng, self.split)
        name = str(names[int(self.rng.integers(len(names)))])
        return self.library.thing_of(name, self.rng, self.split)

    def _drop(
        self, thing: Thing, place: Float64, *, turned: bool = False, turn: Float64 | None = None
    ) -> None:
        """Above all whose boxes it would meet."""
        if turn is None:
            yaw = rotation(2, self.rng.uniform(0, 2 * np.pi))
            turn = Pose(np.zeros(3), random_quaternion(self.rng)).rotation if turned else yaw
        low, high = box_about(thing.parts, Pose(np.zeros(3), _quaternion(turn)))
        at = np.array([*(place - (low + high)[:2] / 2), 0.0])
        ground = max(
            (
                item.high[2]
                for item in self.placements
                if (at + low < item.high)[:2].all()
                and (at + high > item.low)[:2].all()
                and not item.fixed
            ),
            default=0.0,
        )
        at[2] = ground + _DROPPED - low[2]
        self._put(thing, at, turn)

    def _put(self, thing: Thing, at: Float64, turn: Float64) -> None:
        self.placements.append(Placement(thing, Pose(at, _quaternion(turn))))


_MAX_ROW = 0.7  # m


def _still() -> Pose:
    return Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def _quaternion(turn: Float64) -> Float64:
    return quaternion_from_rotation(turn)


def _opening(holder: Thing) -> float:
    """Width of what is hollow, by the narrower side of its box (m)."""
    low, high = box_about(holder.parts, _still())
    return float((high - low)[:2].min())
