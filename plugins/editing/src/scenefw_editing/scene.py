"""A scene to change from Python: every change gives a new scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenefw.api.output import render, save
from scenefw.api.settings import Settings
from scenefw.core.errors import ConfigError, InputError
from scenefw.perception.physics.support_graph import SupportGraph, support_graph
from scenefw_editing import scene_editing
from scenefw_editing.contact_words import contact_words
from scenefw_editing.stored_scenes import read_scene

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from scenefw.core.types import Camera, ObjectEstimate, PlacedShape, SceneEstimate

_NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """Objects in the world frame: z up, floor z = 0, metres. It never changes.

    Args:
        origin: the scene that it comes from, with camera and grid.
        objects: each with `id`, `mesh`, `pose`, `extents`, `confidence` and `placed`.
    """

    origin: SceneEstimate
    objects: tuple[ObjectEstimate, ...]

    @classmethod
    def of(cls, estimate: SceneEstimate) -> Scene:
        """The scene of an estimate, such as one of `Prediction.samples`."""
        return cls(estimate, estimate.objects)

    @classmethod
    def read(cls, path: str | Path) -> Scene:
        """A scene from `scene.json`, or from the folder of a prediction.

        Raises:
            InputError: there is none, or it is damaged.
        """
        return cls.of(read_scene(Path(path).expanduser()))

    @classmethod
    def built(cls, words: Sequence[str]) -> Scene:
        """The scene in `input`, as `run=edit` reads it."""
        (path,) = Settings(words).build("input")
        if path is None:
            raise ConfigError(
                'scenefw.load("scene") needs input=PATH of a scene.json or its folder'
            )
        return cls.read(path)

    @cached_property
    def estimate(self) -> SceneEstimate:
        """The scene with volumes, which are made of meshes after a change."""
        return scene_editing.with_objects(self.origin, self.objects)

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Objects that run into each other or the floor, or that nothing carries, with numbers."""
        return tuple(contact_words(self.objects))

    @cached_property
    def support_graph(self) -> SupportGraph:
        """What stands on what, what falls if something goes, and an order to take things away."""
        return support_graph(self.objects)

    @property
    def ids(self) -> list[int]:
        """Of the objects."""
        return [item.id for item in self.objects]

    def __len__(self) -> int:
        """Number of objects."""
        return len(self.objects)

    def __iter__(self) -> Iterator[ObjectEstimate]:
        """The objects."""
        return iter(self.objects)

    def __getitem__(self, label: int) -> ObjectEstimate:
        """The object with this id.

        Raises:
            InputError: there is none.
        """
        return scene_editing.named(self.objects, label)

    def __repr__(self) -> str:
        return f"Scene({self.origin.frame.name!r}, objects {self.ids})"

    def remove(self, *labels: int) -> Scene:
        """Without objects.

        Raises:
            InputError: there is no such object.
        """
        objects = self.objects
        for label in labels:
            objects = scene_editing.removed(objects, label)
        return replace(self, objects=objects)

    def move(
        self,
        label: int,
        by: ArrayLike = _NOWHERE,
        *,
        turn: float = 0.0,
        axis: ArrayLike = (0.0, 0.0, 1.0),
    ) -> Scene:
        """With an object elsewhere.

        Args:
            label: id of the object.
            by: x, y, z (m).
            turn: degrees about an axis through its centre of mass.
            axis: of the world; the default is the vertical.

        Raises:
            InputError: there is no such object, or numbers are wrong.
        """
        return replace(self, objects=scene_editing.moved_by(self.objects, label, by, turn, axis))

    def scale(self, label: int, factor: float) -> Scene:
        """With an object larger or smaller, standing at the height where it stood.

        Raises:
            InputError: there is no such object, or the factor is not positive.
        """
        return replace(self, objects=scene_editing.scaled(self.objects, label, factor))

    def swap(self, first: int, second: int) -> Scene:
        """With the shapes of two objects exchanged; ids stay with the places.

        Raises:
            InputError: there is no such object, or both are one.
        """
        return replace(self, objects=scene_editing.swapped(self.objects, first, second))

    def add(self, item: ObjectEstimate | PlacedShape, by: ArrayLike = _NOWHERE) -> Scene:
        """With another object; it is the last one and has the next id.

        Args:
            item: an object of this scene or of another one, or a shape and its pose.
            by: where it goes from where it is (m).

        Raises:
            InputError: numbers are wrong.
        """
        return replace(self, objects=scene_editing.added(self.objects, item, by))

    def add_superquadric(
        self,
        half_axes: ArrayLike,
        exponents: ArrayLike = (2.0, 2.0, 2.0),
        position: Sequence[float | None] = (0.0, 0.0, None),
        turn: float = 0.0,
    ) -> Scene:
        """With a superquadric |x/a1|^r + |y/a2|^s + |z/a3|^t = 1.

        Args:
            half_axes: (3,) m.
            exponents: (3,) r, s, t: 2 is round, 20 like a block.
            position: (3,) of its centre (m); a height of None puts it on the floor.
            turn: degrees about the vertical.

        Raises:
            InputError: numbers are wrong.
        """
        return self.add(scene_editing.superquadric(half_axes, exponents, position, turn))

    def join(self, other: Scene, by: ArrayLike = _NOWHERE) -> Scene:
        """With the objects of another scene too, which get the next ids.

        Args:
            other: the second scene.
            by: where it goes (m).

        Raises:
            InputError: it is no scene, or numbers are wrong.
        """
        if not isinstance(other, Scene):
            raise InputError(
                f"join takes a Scene, got a {type(other).__name__}; give Scene.read(PATH), or "
                "scene() of a prediction"
            )
        return replace(self, objects=scene_editing.joined(self.objects, other.objects, by))

    def settle(self, *overrides: str) -> Scene:
        """With the objects at rest, by a simulation; those that would move far stay.

        Args:
            overrides: as on the command line, such as `"engine=mujoco"`.

        Raises:
            ConfigError: a setting is wrong.
            MissingDependencyError: the simulator is not installed.
        """
        settings = Settings(["settling=physics", *overrides])
        (settling,) = settings.build("settling")
        with settings.computing():
            (settled,) = settling.settle([self.estimate])
        estimate = scene_editing.with_objects(self.origin, settled.objects)
        return Scene.of(replace(estimate, details=settled.details))

    def save(self, path: str | Path, **settings: Any) -> Path:
        """Writes the scene, as `Prediction.save` does."""
        return save(self.estimate, path, settings)

    def render(self, camera: Camera | None = None, *, turn: float = 0.0) -> NDArray[np.uint8]:
        """A picture, as of `Prediction.render`: RGB (H, W, 3) uint8."""
        return render(self.estimate, camera, turn)
