"""Cluttered tables: things beside, on and against each other, cables over them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import quaternion_from_rotation
from scenefw.core.labelling_protocols import TabletopModels
from scenefw.core.settings import POSITIVE, below
from scenefw.core.tabletop import TabletopGeometry, TabletopItem, TabletopScene
from scenefw_tabletops.scenes import desk_light
from scenefw_tabletops.scenes.drape import draped
from scenefw_tabletops.scenes.numbers import NumberedScenes, require_draws
from scenefw_tabletops.scenes.resting import Body, Relief, Rest, body_of, resting_pose
from scenefw_tabletops.scenes.tabletop import assemble

Array = NDArray[np.float64]

_TURNS = (np.eye(3), np.diag([1.0, -1.0, -1.0]), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]))
_SOLID = ("brick",)  # what lies on any side
_FREE, _BESIDE, _ONTO = range(3)
_FLAT, _LOW = 0.08, 0.012  # rad, m: what lies free or is pushed stays flat and low
_HOLLOW, _TIGHT = 0.025, 0.004  # m: space under most of a thing that leans, or lies flat
_TOUCH = 0.0012  # m: neighbours whose heights differ less don't stop a thing that is pushed


class DeskGenerator(NumberedScenes):
    """Puts models down one after the other, large ones first; each comes to rest on the others.

    A model lies free, is pushed up to another one, or is put on it and tilts until it rests. What
    finds no place is left out. Scene i depends on (seed, i) alone.

    Args:
        models: where models come from; classes without any in a split are left out.
        scenes: number of scenes for training, validation and test, numbered in this order.
        minimum: of models drawn per scene.
        maximum: of models drawn per scene.
        weights: how often a class is drawn, by name; 1 for all others.
        placed: shares of models that lie free, touch another one, or lie on it.
        scales: least and greatest size of a model by its own.
        extent: side of the square about the origin (m).
        border: least distance of models from its sides (m).
        steepest: greatest tilt (degrees).
        highest: greatest height of anything (m).
        trials: places tried per model.

    Raises:
        ConfigError: numbers that make no scene.
    """

    def __init__(
        self,
        models: TabletopModels,
        scenes: Sequence[int] = (500, 120, 27),
        minimum: int = 48,
        maximum: int = 76,
        weights: dict[str, float] | None = None,
        placed: Sequence[float] = (0.25, 0.4, 0.35),
        scales: tuple[float, float] = (0.95, 1.05),
        extent: float = 1.024,
        border: float = 0.012,
        steepest: float = 28.0,
        highest: float = 0.11,
        trials: int = 25,
    ) -> None:
        super().__init__(scenes)
        self.scales = require_draws(minimum, maximum, scales, trials)
        if border < 0 or not extent > 2 * border:
            raise ConfigError(f"border = {border} m leaves no room on {extent} m; lower it")
        if len(placed) != 3 or min(placed) < 0 or not sum(placed) > 0:
            raise ConfigError(f"placed = {list(placed)}: expected three shares from 0 on")
        below(60).require(steepest=steepest)
        POSITIVE.require(highest=highest)
        self.models, self.classes = models, tuple(models.classes)
        self.minimum, self.maximum, self.trials = minimum, maximum, trials
        self.placed = np.asarray(placed, dtype=np.float64) / sum(placed)
        self.weights = self._weights(dict(weights or {}))
        self.extent = extent - 2 * border
        self.steepest, self.highest = float(np.deg2rad(steepest)), highest
        self._bodies: dict[tuple[int, int, int], Body] = {}

    def generate(self, index: int, seed: int) -> TabletopScene:
        """Scene number `index` of the data set `seed`."""
        rng = streams.generator(seed, index)
        look = desk_light.surface(rng)
        lights, ambient = desk_light.lamps(rng)
        samples = self._draw(rng, self.split_of(index))
        table = _Table(self, Relief(self.extent), rng)
        for label, instance, scale in samples:
            table.place_model(label, instance, scale)
        surface = (*look.colour, *look.texture())
        items = tuple(table.items)
        return TabletopScene(items, surface, lights, ambient, self.classes, index, seed)

    def geometry(self, scene: TabletopScene) -> TabletopGeometry:
        """The triangles of a scene."""
        return assemble(scene, self.models)

    def body(self, label: int, instance: int, turn: int) -> Body:
        """A model's columns, turned to one of its sides first."""
        key = (label, instance, turn)
        if key not in self._bodies:
            mesh = self.models.model(label, instance)
            self._bodies[key] = body_of(mesh.vertices @ _TURNS[turn].T, mesh.faces)
        return self._bodies[key]

    def _weights(self, weights: dict[str, float]) -> Array:
        unknown = sorted(set(weights) - set(self.classes[1:]))
        class_weights = np.array(
            [weights.get(name, 1.0) for name in self.classes[1:]], dtype=np.float64
        )
        if unknown or class_weights.min() < 0 or not class_weights.sum() > 0:
            raise ConfigError(
                f"weights = {weights}: expected numbers from 0 on for {', '.join(self.classes[1:])}"
            )
        return class_weights

    def _draw(self, rng: np.random.Generator, split: str) -> list[tuple[int, int, float]]:
        """Labels, instances and scales, the largest model first and what is limp last."""
        count = int(rng.integers(self.minimum, self.maximum + 1))
        stock = {
            label: self.models.instances(label, split) for label in range(1, len(self.classes))
        }
        chance = self.weights * [len(stock[label]) > 0 for label in stock]
        samples = []
        for label in rng.choice(list(stock), count, p=chance / chance.sum()):
            instance = int(rng.choice(np.asarray(stock[int(label)])))
            samples.append((int(label), instance, float(rng.uniform(*self.scales))))
        return sorted(samples, key=self._order, reverse=True)

    def _order(self, item: tuple[int, int, float]) -> float:
        mesh = self.models.model(*item[:2])
        area = float(np.prod(np.ptp(mesh.vertices[:, :2], axis=0))) * item[2] ** 2
        return 1e-3 * area if mesh.spine is not None else area


class _Table:
    """A scene in the making."""

    def __init__(self, maker: DeskGenerator, relief: Relief, rng: np.random.Generator) -> None:
        self.maker, self.relief, self.rng = maker, relief, rng
        self.items: list[TabletopItem] = []
        self._radii: list[float] = []

    def place_model(self, label: int, instance: int, scale: float) -> None:
        """Adds a model where it finds a place."""
        if self.maker.models.model(label, instance).spine is not None:
            self._lay(label, instance)
            return
        name = self.maker.classes[label]
        turn = int(self.rng.choice(3, p=[0.6, 0.2, 0.2])) if name in _SOLID else 0
        body = self.maker.body(label, instance, turn)
        way = int(self.rng.choice(3, p=self.maker.placed)) if self.items else _FREE
        for trial in range(self.maker.trials):
            pose = self._try(body, scale, way if trial < 0.7 * self.maker.trials else _FREE)
            if pose is not None:
                self._add(label, instance, scale, body, pose, _TURNS[turn])
                return

    def _try(self, body: Body, scale: float, way: int) -> Rest | None:
        """One random attempt to put a model down, None if it can't lie there.

        Args:
            body: the model.
            scale: its size by its own.
            way: anywhere on the table (`_FREE`), pushed against another thing (`_BESIDE`), or on
                another thing (`_ONTO`).
        """
        yaw = self.rng.uniform(0, 2 * np.pi)
        half = self.relief.half
        place = self.rng.uniform(-half, half, 2)
        if way != _FREE:
            number = int(self.rng.integers(len(self.items)))
            neighbour, radius = self.items[number], self._radii[number]
            if self.rng.random() < 0.5:  # along its sides
                yaw = neighbour.yaw + self.rng.integers(4) * np.pi / 2 + self.rng.normal(0, 0.02)
            middle = np.array([neighbour.x, neighbour.y])
            azimuth = self.rng.uniform(0, 2 * np.pi)
            ahead = np.array([np.cos(azimuth), np.sin(azimuth)])
            if way == _ONTO:
                reach = radius + (0.6 * scale * body.radius if self.rng.random() < 0.5 else 0)
                place = middle + ahead * reach * np.sqrt(self.rng.random())
            else:
                pushed = self._pushed(body, scale, yaw, middle, ahead, radius)
                if pushed is None:
                    return None
                place = pushed
        onto = way == _ONTO
        steepest, highest = (self.maker.steepest, np.inf) if onto else (_FLAT, _LOW)
        turned = _yawed(yaw)
        pose = resting_pose(body, self.relief, place, turned, scale, steepest, highest)
        if pose is None or pose.hollow > (_HOLLOW if onto else _TIGHT):
            return None
        top = pose.moved(scale * body.high)[:, 2].max()
        return pose if top < self.maker.highest else None

    def _pushed(
        self, body: Body, scale: float, yaw: float, middle: Array, ahead: Array, radius: float
    ) -> Array | None:
        """The place where a thing that slides towards another one along the table meets it."""
        underside = scale * body.low[:: max(1, len(body.low) // 150)] @ _yawed(yaw).T
        start_distance, end_distance = radius + scale * body.radius + 0.004, 0.0
        for step in (0.004, 0.0005):
            distances = np.arange(start_distance, end_distance, -step)
            path = middle + distances[:, None] * ahead
            points = path[:, None] + underside[None, :, :2]
            out = np.abs(points).max(axis=(1, 2)) >= self.relief.half - self.relief.cell
            if out.any():  # beyond the table first, and over it later
                path, points = path[~out], points[~out]
            met = np.any(self.relief.at(points) - underside[None, :, 2] > _TOUCH, axis=1)
            if not met.any() or met[0]:
                return None
            stop = int(np.argmax(met))
            start_distance, end_distance = (
                float(np.linalg.norm(path[k] - middle)) for k in (stop - 1, stop)
            )
        return np.asarray(path[stop - 1])

    def _add(
        self, label: int, instance: int, scale: float, body: Body, pose: Rest, turn: Array
    ) -> None:
        rotation = pose.rotation @ turn
        yaw = float(np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0]))
        q = quaternion_from_rotation(_yawed(-yaw) @ rotation)
        w, i, j, k = (float(part) for part in q)
        x, y, z = (float(part) for part in pose.origin)
        self.items.append(TabletopItem(label, instance, x, y, yaw, scale, z, (w, i, j, k)))
        self._radii.append(scale * body.radius)
        self.relief.raise_to(pose.moved(scale * body.high))

    def _lay(self, label: int, instance: int) -> None:
        """Lays a cable or the like over the table and what is on it, at a random place."""
        spine = self.maker.models.model(label, instance).spine
        if spine is None:
            raise TypeError("only what has a spine is limp")
        for _ in range(self.maker.trials):
            yaw = self.rng.uniform(0, 2 * np.pi)
            place = self.rng.uniform(-self.relief.half, self.relief.half, 2)
            drape = draped(spine @ _yawed(yaw).T + [*place, 0.0], self.relief)
            if drape is None:
                continue
            self.items.append(
                TabletopItem(label, instance, float(place[0]), float(place[1]), yaw,
                             lifts=tuple(drape.lifts.tolist()))
            )  # fmt: skip
            self._radii.append(float(np.linalg.norm(spine[:, :2], axis=1).max()))
            self.relief.raise_to(drape.top)
            return


def _yawed(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
