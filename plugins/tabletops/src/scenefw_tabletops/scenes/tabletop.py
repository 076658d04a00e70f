"""Table-top scenes: models placed side by side on a square of table, under random lamps."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import rotation_from_quaternion
from scenefw.core.labelling_protocols import TabletopModels
from scenefw.core.tabletop import PLACEMENT, Light, TabletopGeometry, TabletopItem, TabletopScene
from scenefw_tabletops.scenes.numbers import NumberedScenes, require_draws
from scenefw_tabletops.shapes.tabletop import colours

Array = NDArray[np.float64]


class TabletopGenerator(NumberedScenes):
    """Places random models uniformly, turned at random, with gaps between their convex outlines.

    Larger models are placed first, so that the table fills; one that finds no room is left out.
    Scene i depends on (seed, i) alone. Its number says which part of the data it belongs to, and
    that which instances of models may lie in it.

    Args:
        models: where models come from.
        scenes: number of scenes for training, validation and test, numbered in this order.
        minimum: of models drawn per scene.
        maximum: of models drawn per scene.
        scales: least and greatest size of a model by its own.
        extent: side of the square about the origin (m).
        border: least distance of models from its sides (m).
        gap: least distance between the convex outlines of two models (m).
        trials: places tried per model.

    Raises:
        ConfigError: numbers that make no scene.
    """

    def __init__(
        self,
        models: TabletopModels,
        scenes: Sequence[int] = (500, 120, 27),
        minimum: int = 9,
        maximum: int = 16,
        scales: tuple[float, float] = (0.95, 1.05),
        extent: float = 1.024,
        border: float = 0.012,
        gap: float = 0.006,
        trials: int = 60,
    ) -> None:
        super().__init__(scenes)
        self.scales = require_draws(minimum, maximum, scales, trials)
        if border < 0 or gap < 0 or not extent > 2 * border:
            raise ConfigError(
                f"border = {border}, gap = {gap} m leave no room on {extent} m; lower them"
            )
        self.models = models
        self.classes = tuple(models.classes)
        self.minimum, self.maximum = minimum, maximum
        self.trials = trials
        self.half, self.gap = extent / 2 - border, gap
        self._outlines: dict[tuple[int, int], Array] = {}

    def generate(self, index: int, seed: int) -> TabletopScene:
        """Scene number `index` of the data set `seed`."""
        rng = streams.generator(seed, index)
        look = colours.table(rng)
        lights, ambient = _lamps(rng)
        return TabletopScene(
            self._place(self._draw(rng, self.split_of(index)), rng),
            (*look.colour, *look.texture()),
            lights,
            ambient,
            self.classes,
            index,
            seed,
        )

    def geometry(self, scene: TabletopScene) -> TabletopGeometry:
        """The triangles of a scene."""
        return assemble(scene, self.models)

    def _draw(self, rng: np.random.Generator, split: str) -> list[tuple[int, int, float]]:
        """Labels, instances and scales, the largest model first."""
        samples = []
        for _ in range(int(rng.integers(self.minimum, self.maximum + 1))):
            label = int(rng.integers(1, len(self.classes)))
            instance = int(rng.choice(np.asarray(self.models.instances(label, split))))
            samples.append((label, instance, float(rng.uniform(*self.scales))))
        return sorted(samples, key=self._size, reverse=True)

    def _size(self, item: tuple[int, int, float]) -> float:
        outline = self._outline(*item[:2]) * item[2]
        return float(np.prod(np.ptp(outline, axis=0)))

    def _place(
        self, samples: Sequence[tuple[int, int, float]], rng: np.random.Generator
    ) -> tuple[TabletopItem, ...]:
        items: list[TabletopItem] = []
        outlines: list[Array] = []
        for label, instance, scale in samples:
            outline = self._outline(label, instance) * scale
            for _ in range(self.trials):
                yaw = float(rng.uniform(0, 2 * np.pi))
                turned = outline @ _rotation(yaw).T
                low, high = -self.half - turned.min(axis=0), self.half - turned.max(axis=0)
                place = rng.uniform(low, np.maximum(low, high))
                candidate = turned + place
                if (high > low).all() and all(
                    are_separate(candidate, neighbour, self.gap) for neighbour in outlines
                ):
                    items.append(
                        TabletopItem(label, instance, float(place[0]), float(place[1]), yaw, scale)
                    )
                    outlines.append(candidate)
                    break
        return tuple(items)

    def _outline(self, label: int, instance: int) -> Array:
        if (label, instance) not in self._outlines:
            outline = outline_of(self.models.model(label, instance).vertices)
            self._outlines[label, instance] = outline
        return self._outlines[label, instance]


def outline_of(vertices: Array) -> Array:
    """Convex outline (K, 2) of vertices (V, 3) seen from above, counter-clockwise."""
    flat = np.asarray(vertices[:, :2], dtype=np.float64)
    return np.asarray(flat[ConvexHull(flat).vertices])


def are_separate(first: Array, second: Array, gap: float) -> bool:
    """Whether a side of one convex outline (K, 2) is at least `gap` away from the other outline.

    Where corner faces corner, outlines somewhat farther apart than `gap` may count as too near.
    """
    return _side_separates(first, second, gap) or _side_separates(second, first, gap)


def assemble(scene: TabletopScene, models: TabletopModels) -> TabletopGeometry:
    """The triangles of a scene whose models come from `models`."""
    meshes = [models.model(item.label, item.instance) for item in scene.items]
    corners, normals, placements = [], [], []
    for item, mesh in zip(scene.items, meshes, strict=True):
        turn = rotation_of(item)
        place = np.array([item.x, item.y, item.z])
        corners.append(((item.scale * mesh.vertices) @ turn.T + place)[mesh.faces])
        if item.lifts and mesh.knots is not None:
            corners[-1][..., 2] += np.asarray(item.lifts)[mesh.knots[mesh.faces]]
        normals.append(mesh.normals @ turn.T)
        placements.append([*place, *turn.ravel(), item.scale])
    counts = [len(mesh.faces) for mesh in meshes]
    first_row = 1 + np.cumsum([0, *(len(mesh.textures) for mesh in meshes)])
    return TabletopGeometry(
        _concatenate(corners, (3, 3)),
        _concatenate(normals, (3, 3)),
        _concatenate([mesh.colours for mesh in meshes], (3,)),
        _concatenate(
            [m.texture_of + row for m, row in zip(meshes, first_row, strict=False)], (), np.int32
        ),
        np.repeat(np.arange(len(meshes), dtype=np.int32), counts),
        np.array([item.label for item in scene.items], dtype=np.int32),
        np.array(placements, dtype=np.float32).reshape(-1, PLACEMENT),
        np.concatenate([[scene.surface[3:]], *(m.textures for m in meshes)]).astype(np.float32),
        np.array(scene.surface[:3], dtype=np.float32),
        np.array([[*lamp.position, *lamp.intensity] for lamp in scene.lights], dtype=np.float32),
        np.array(scene.ambient, dtype=np.float32),
        scene.classes,
        f"tabletop/{scene.index}",
    )


def rotation_of(item: TabletopItem) -> Array:
    """Rotation (3, 3) from a model at rest to the item as it lies."""
    turn = np.eye(3)
    turn[:2, :2] = _rotation(item.yaw)
    if item.rotation[0] == 1.0:
        return turn
    return np.asarray(turn @ rotation_from_quaternion(item.rotation))


def _side_separates(first: Array, second: Array, gap: float) -> bool:
    side = np.roll(first, -1, axis=0) - first
    outward = np.column_stack([side[:, 1], -side[:, 0]])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    distance = (second @ outward.T).min(axis=0) - (first * outward).sum(axis=1)
    return bool(distance.max() >= gap)


def _lamps(
    rng: np.random.Generator,
) -> tuple[tuple[Light, ...], tuple[float, float, float]]:
    """One to three lamps and the light of the room; together near 1 at the table's middle."""
    count = int(rng.integers(1, 4))
    lamps, strength = [], 0.0
    for number in range(count):
        elevation, azimuth = np.deg2rad(rng.uniform(35, 80)), rng.uniform(0, 2 * np.pi)
        ahead = np.cos(elevation) * np.array([np.cos(azimuth), np.sin(azimuth)])
        position = rng.uniform(1.0, 2.5) * np.array([*ahead, np.sin(elevation)])
        share = rng.uniform(0.5, 1.0) * 0.5**number
        lamps.append((position, share * _tint(rng)))
        strength += share * np.sin(elevation)
    room = rng.uniform(0.35, 0.9) * strength
    scale = rng.uniform(0.75, 1.2) / (strength + room)
    ambient = room * scale * _tint(rng)
    lights = tuple(
        Light(_three(position), _three(scale * intensity)) for position, intensity in lamps
    )
    return lights, _three(ambient)


def _tint(rng: np.random.Generator) -> Array:
    """White, warm or cold."""
    warmth = rng.uniform(-0.12, 0.18)
    return np.array([1 + warmth, 1.0, 1 - warmth])


def _three(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _rotation(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])


def _concatenate(
    parts: Sequence[NDArray], shape: tuple[int, ...], dtype: type = np.float32
) -> NDArray:
    if not parts:
        return np.zeros((0, *shape), dtype=dtype)
    return np.concatenate(parts).astype(dtype)
