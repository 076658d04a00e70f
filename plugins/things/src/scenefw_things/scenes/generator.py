"""Scenes of 2 to 20 things at rest on a table, among what is no thing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose
from scenefw.scenes.splits import split_of
from scenefw_things.scenes.arrangements import Arranger, Placement
from scenefw_things.scenes.physics import FastPhysics
from scenefw_things.scenes.scene import OBJECT, SUPPORT, ThingItem, ThingScene
from scenefw_things.scenes.surroundings import Surroundings
from scenefw_things.shapes.source import Things

ARRANGEMENTS = ("pile", "scatter", "row", "nest", "lean", "fill")

_MAX_PENETRATION = 0.002  # m: of things that stay in the scene
_FALLEN = -0.02  # m: what is lower has left the table


class ThingScenes:
    """Drops groups of things on a table and keeps what comes to rest there.

    Groups are piled, scattered, in rows without a gap, nested, leaning, or in trays. What falls
    off the table, or stays stuck in another, is taken out; then the rest settles once more. Scene
    i depends on (seed, i) alone, and its part of the data on them too.

    Args:
        shapes: the library of things.
        physics: lets them fall.
        surroundings: draws the table and what is no thing.
        minimum: fewest things of a scene.
        maximum: most things of a scene.
        arrangements: how often a group is of each kind, by name.
        split: part of the data of all scenes; None draws train, val or test for each.

    Raises:
        ConfigError: counts out of order, or an unknown arrangement.
    """

    def __init__(
        self,
        shapes: Things,
        physics: FastPhysics,
        surroundings: Surroundings,
        minimum: int = 2,
        maximum: int = 20,
        arrangements: Mapping[str, float] | None = None,
        split: str | None = None,
    ) -> None:
        if not 1 <= minimum <= maximum <= _MAX_THINGS:
            raise ConfigError(
                f"scene.minimum = {minimum}, scene.maximum = {maximum}: expected 1 <= minimum <= "
                f"maximum <= {_MAX_THINGS}"
            )
        self.arrangements = dict.fromkeys(ARRANGEMENTS, 1.0) | dict(arrangements or {})
        unknown = sorted(set(self.arrangements) - set(ARRANGEMENTS))
        if unknown or not sum(self.arrangements.values()) > 0:
            raise ConfigError(
                f"scene.arrangements = {dict(arrangements or {})}: expected numbers for "
                f"{', '.join(ARRANGEMENTS)}"
            )
        self.shapes, self.physics, self.surroundings = shapes, physics, surroundings
        self.minimum, self.maximum, self.split = minimum, maximum, split

    def generate(self, index: int, seed: int) -> ThingScene | None:
        """Scene number `index` of the data set `seed`; None if too few things stayed."""
        rng = streams.generator(seed, index)
        split = self.split or split_of(seed, index)
        floor, supports = self.surroundings.table(rng)
        placements = self._arranged(rng, split)
        at_rest = self._settled(placements, supports)
        if sum(not item.fixed for item in at_rest) < self.minimum:
            return None
        items = list(supports)
        for item in at_rest:
            role = SUPPORT if item.fixed else OBJECT
            items.append(ThingItem(item.thing, item.pose, role, int(rng.integers(2**31))))
        items += self.surroundings.obstacles(rng, items, floor)
        return ThingScene(tuple(items), floor, int(rng.integers(2**31)), index, seed, split)

    def _arranged(self, rng: np.random.Generator, split: str) -> list[Placement]:
        """Groups about several places, until the number of things is reached."""
        arranger = Arranger(self.shapes.library, split, rng)
        low, high = np.log([self.minimum, self.maximum + 1])
        target = int(np.exp(rng.uniform(low, high)))
        names = list(self.arrangements)
        shares = np.array([self.arrangements[name] for name in names])
        for number in range(target):
            missing = target - len(arranger.placements)
            if missing <= 0:
                break
            place = _PLACES[number % len(_PLACES)] + rng.normal(0, 0.03, 2)
            count = int(rng.integers(1, missing + 1))
            name = str(rng.choice(names, p=shares / shares.sum()))
            if name in ("nest", "lean"):
                getattr(arranger, name)(place)
            else:
                getattr(arranger, name)(place, count)
        return arranger.placements

    def _settled(self, placements: list[Placement], supports: list[ThingItem]) -> list[Placement]:
        """The placements where they rest, without those that fell off or are stuck."""
        for _ in range(_ROUNDS):
            self.physics.begin(floor=not supports)
            for support in supports:
                self.physics.add(support.thing.parts, support.pose, fixed=True)
            bodies = [self.physics.add(item.thing.parts, item.pose, fixed=item.fixed)
                      for item in placements]  # fmt: skip
            at_rest = self.physics.settle()
            sound: list[Placement] = []
            for body, item in zip(bodies, placements, strict=True):
                pose = item.pose if item.fixed else self.physics.pose(body, item.thing.parts)
                moved = Placement(item.thing, _stored(pose), item.fixed)
                stuck = self.physics.penetration(body) > _MAX_PENETRATION
                if item.fixed or not (stuck or moved.low[2] < _FALLEN):
                    sound.append(moved)
            if at_rest and len(sound) == len(placements):
                return sound
            placements = sound
        return []


_MAX_THINGS = 60  # labels of images are int8, and the surroundings need some too
_ROUNDS = 3  # of settling, after what fell or is stuck was taken out
_PLACES = np.array(
    [[0, 0], [0.22, 0.05], [-0.2, 0.12], [0.05, -0.22], [-0.12, -0.2], [0.2, 0.25], [-0.25, -0.05]]
)
"""Where groups are, about the middle of the table (m)."""


def _stored(pose: Pose) -> Pose:
    """The pose with a unit quaternion, w >= 0."""
    quaternion = pose.quaternion / np.linalg.norm(pose.quaternion)
    return Pose(pose.position, quaternion if quaternion[0] >= 0 else -quaternion)
