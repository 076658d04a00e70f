"""Stacks of objects dropped one after the other (thesis 5.2.1, algorithm 1)."""

from __future__ import annotations

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import random_quaternion
from scenefw.core.protocols import Engine, ShapeSource
from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE, at_least
from scenefw.core.types import Pose, Scene, SceneObject, Shape
from scenefw.scenes.splits import SPLITS, split_of

_WATCH = 48  # steps between checks of whether the new object has left the limits


class StackGenerator:
    """Drops shapes at random poses and keeps those that come to rest inside the limits.

    Its part of the data set decides which shapes a scene may have.

    Differs from algorithm 1 in that the number of objects to place is drawn uniformly (the thesis
    goes for the maximum and takes what comes); rotations are uniform (three uniform angles are
    not); a drop ends when everything rests (the thesis always runs 1000 steps) or when the new
    object has left the limits; it counts only if *all* objects rest inside the limits, else the
    scene is put back as it was before; and the finished scene, rounded as stored, is simulated on
    from a fresh world until it stays where it is.

    Args:
        shapes: where objects come from.
        engine: simulates them.
        minimum: fewest objects of a scene.
        maximum: most objects of a scene.
        trials: placements tried per object.
        lower: lowest x, y, z of object centres (m).
        upper: highest x, y, z of object centres (m).
        max_steps: steps within which a drop must come to rest.
        density: of every object (kg/m^3).
        check_steps: steps that the finished scene must stand by itself.
        checks: how often it may go on moving and be checked again.
        max_shift: how far an object that stands may move in a check (m) ...
        max_turn: ... and how far turn (rad).
        split: part of the data set that all scenes belong to, as final; None draws train, val or
            test for each scene (`splits.split_of`).

    Raises:
        ConfigError: the counts or limits are empty, or there is no such part.
    """

    def __init__(
        self,
        shapes: ShapeSource,
        engine: Engine,
        minimum: int = 3,
        maximum: int = 4,
        trials: int = 10,
        lower: tuple[float, float, float] = (-0.25, -0.25, 0.0),
        upper: tuple[float, float, float] = (0.25, 0.25, 0.60),
        max_steps: int = 1000,
        density: float = 500.0,
        check_steps: int = 240,
        checks: int = 12,
        max_shift: float = 3e-4,
        max_turn: float = 0.01,
        split: str | None = None,
    ) -> None:
        if split is not None and split not in SPLITS:
            raise ConfigError(
                f"scene.split = {split}: expected one of {', '.join(SPLITS)}, or null to draw it"
            )
        COUNT.require(minimum=minimum)
        at_least(minimum).require(maximum=maximum)
        if np.any(np.asarray(lower) >= np.asarray(upper)):
            raise ConfigError(f"scene.lower = {lower} is not below scene.upper = {upper}")
        COUNT.require(trials=trials, max_steps=max_steps)
        POSITIVE.require(density=density)
        NOT_NEGATIVE.require(check_steps=check_steps, checks=checks)
        NOT_NEGATIVE.require(max_shift=max_shift, max_turn=max_turn)
        self.shapes = shapes
        self.engine = engine
        self.minimum = minimum
        self.maximum = maximum
        self.trials = trials
        self.lower = np.asarray(lower, dtype=np.float64)
        self.upper = np.asarray(upper, dtype=np.float64)
        self.max_steps = max_steps
        self.density = density
        self.check_steps = check_steps
        self.checks = checks
        self.max_shift = max_shift
        self.max_turn = max_turn
        self.split = split

    def generate(self, index: int, seed: int) -> Scene | None:
        """Attempt number `index` of the data set `seed`; None if it failed."""
        rng = streams.generator(seed, index)
        split = self.split or split_of(seed, index)
        objects: tuple[SceneObject, ...] = ()
        handles = self._rebuild(objects)
        for _ in range(rng.integers(self.minimum, self.maximum, endpoint=True)):
            for _ in range(self.trials):
                item = self._draw(rng, split)
                handle = self.engine.add(item)
                if self.engine.overlaps(handle):
                    self.engine.remove(handle)
                elif self._drop(handle, [*handles, handle]):
                    handles.append(handle)
                    objects = self._where_they_are((*objects, item), handles)
                    break
                else:
                    handles = self._rebuild(objects)
        if len(objects) < self.minimum:
            return None
        standing = self._standing(objects)
        return None if standing is None else Scene(standing, index, seed, split)

    def _draw(self, rng: np.random.Generator, split: str) -> SceneObject:
        shape: Shape = self.shapes.sample(rng, split)
        pose = Pose(rng.uniform(self.lower, self.upper), random_quaternion(rng))
        return _rounded(SceneObject(shape, pose, self.density * shape.volume()))

    def _drop(self, handle: int, handles: list[int]) -> bool:
        for _ in range(0, self.max_steps, _WATCH):
            at_rest = self.engine.settle(_WATCH)
            if at_rest or not self._inside(handle):
                return at_rest and all(self._inside(body) for body in handles)
        return False

    def _inside(self, handle: int) -> bool:
        position = self.engine.pose(handle).position
        return bool(np.all(position >= self.lower) and np.all(position <= self.upper))

    def _where_they_are(
        self, objects: tuple[SceneObject, ...], handles: list[int]
    ) -> tuple[SceneObject, ...]:
        return tuple(
            SceneObject(item.shape, self.engine.pose(handle), item.mass)
            for item, handle in zip(objects, handles, strict=True)
        )

    def _rebuild(self, objects: tuple[SceneObject, ...]) -> list[int]:
        self.engine.reset()
        return [self.engine.add(item) for item in objects]

    def _standing(self, objects: tuple[SceneObject, ...]) -> tuple[SceneObject, ...] | None:
        """The objects, rounded as stored, if they stay in place; None if they don't."""
        for _ in range(self.checks):
            objects = tuple(_rounded(item) for item in objects)
            handles = self._rebuild(objects)
            self.engine.simulate(self.check_steps)
            if not all(self._inside(handle) for handle in handles):
                return None
            later = self._where_they_are(objects, handles)
            if all(map(self._stayed, objects, later)):
                return objects
            objects = later
        return None

    def _stayed(self, before: SceneObject, after: SceneObject) -> bool:
        shift = np.linalg.norm(after.pose.position - before.pose.position)
        cosine = min(1.0, abs(float(before.pose.quaternion @ after.pose.quaternion)))
        return bool(shift <= self.max_shift and 2 * np.arccos(cosine) <= self.max_turn)


def _rounded(item: SceneObject) -> SceneObject:
    """The object in float32, as stored: the last bits, in which processors differ, go."""
    position = item.pose.position.astype(np.float32).astype(np.float64)
    quaternion = item.pose.quaternion.astype(np.float32).astype(np.float64)
    return SceneObject(item.shape, Pose(position, quaternion), float(np.float32(item.mass)))
