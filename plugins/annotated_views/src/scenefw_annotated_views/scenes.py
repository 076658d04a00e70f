"""Views of stacks and of table-tops with all about their objects, to export."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import rigid
from scenefw.core.made_of import settings_of
from scenefw.core.protocols import Noise
from scenefw.core.types import Camera, Float32, Frame, Pose, SceneObject, Shape, TriangleMesh
from scenefw.data.batches.stacks import SceneSet
from scenefw.data.batches.views import Viewpoints
from scenefw.kernels.cameras import stack_cameras
from scenefw.noise.frames import depth_noises
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_annotated_views.annotations import AnnotatedObject, AnnotatedView
from scenefw_annotated_views.silhouettes import SolidViews
from scenefw_tabletops.data.table_scenes import TabletopScenes
from scenefw_tabletops.scenes.tabletop import rotation_of

_VIEWS = 7  # random stream
_HALF_TURNS = np.array([np.diag(axes) for axes in ((1.0, -1, -1), (-1.0, 1, -1), (-1.0, -1, 1))])


class StackViews:
    """Depth images of stacks on a floor, from random sides; there is no colour.

    Every superquadric is a model of its own; meshes from files are one model for all scenes, and a
    category each.

    Args:
        scenes: of one split.
        viewpoints: draws cameras.
        split: name of that split.
        noise: disturbs the depth images, applied in the order of the names.
        seed: of views; view j of a scene depends on (seed, the scene's number, j) alone.
        detail: squares per side of the six faces that superquadrics are drawn with.

    Raises:
        ConfigError: a detail below 2, or noise of poses.
    """

    def __init__(
        self,
        scenes: SceneSet,
        viewpoints: Viewpoints,
        split: str = "test",
        noise: Mapping[str, Noise] | None = None,
        seed: int = 0,
        detail: int = 24,
    ) -> None:
        if detail < 2:
            raise ConfigError(f"views.detail = {detail}: expected at least 2 squares per side")
        self.scenes, self.viewpoints, self.split = scenes, viewpoints, split
        self.noise = depth_noises(noise, "annotated views")
        self.seed, self.detail = seed, detail

    @cached_property
    def categories(self) -> tuple[str, ...]:
        """Names of the meshes of all scenes."""
        shapes = (item.shape for i in range(len(self)) for item in self.scenes.objects(i))
        return tuple(sorted({name for shape in shapes if (name := _name(shape))})) or ("object",)

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.scenes)

    def keys(self, scene: int) -> list[Hashable]:
        """Keys of the objects of a scene."""
        return [self._key(scene, i, item) for i, item in enumerate(self.scenes.objects(scene))]

    def objects(self, scene: int) -> tuple[AnnotatedObject, ...]:
        """The objects of a scene."""
        return tuple(
            AnnotatedObject(
                self._key(scene, i, item),
                self._mesh(item),
                item.pose,
                self._category(item),
                _HALF_TURNS if isinstance(item.shape, Superquadric) else None,
            )
            for i, item in enumerate(self.scenes.objects(scene))
        )

    def views(self, scene: int, count: int) -> Iterator[AnnotatedView]:
        """The first `count` views of a scene."""
        objects = self.objects(scene)
        solids = SolidViews([_placed(item) for item in objects])
        number = int(self.scenes.indices[scene])
        for view in range(count):
            random = streams.generator(self.seed, _VIEWS, number, view)
            camera = self.viewpoints.sample(random)
            depth, silhouettes = solids.see(camera)
            depth = self._disturbed(depth, camera, random)
            frame = Frame(depth, camera, name=f"{self.split}/{scene}/{view}")
            yield AnnotatedView(frame, objects, tuple(silhouettes))

    def facts(self) -> dict[str, Any]:
        """What decides what they show."""
        camera = self.viewpoints.sample(streams.generator(self.seed, _VIEWS))
        return {
            "scenes": [int(index) for index in self.scenes.indices],
            "objects": [[repr(item.pose) for item in self.scenes.objects(0)]],
            "split": self.split,
            "seed": self.seed,
            "detail": self.detail,
            "camera": repr(camera),
            "noise": {
                name: settings_of(noise_model) for name, noise_model in sorted(self.noise.items())
            },
        }

    def _key(self, scene: int, number: int, item: SceneObject) -> Hashable:
        return _name(item.shape) or (scene, number)

    def _category(self, item: SceneObject) -> int:
        name = _name(item.shape)
        return self.categories.index(name) if name else 0

    def _mesh(self, item: SceneObject) -> TriangleMesh:
        shape = item.shape
        return shape.mesh(self.detail) if isinstance(shape, Superquadric) else shape.mesh()

    def _disturbed(self, depth: Float32, camera: Camera, random: np.random.Generator) -> Float32:
        seeds = random.integers(2**63 - 1, size=(len(self.noise), 1))
        noisy, cameras = torch.from_numpy(depth)[None], stack_cameras([camera])
        for noise_model, row in zip(self.noise.values(), seeds, strict=True):
            noisy = noise_model.apply(noisy, cameras, torch.from_numpy(row))
        return noisy[0].numpy()


@dataclass(frozen=True, eq=False)
class _Part:
    """An item of a table-top: its class, its mesh as it lies, and how it is turned."""

    label: int
    mesh: TriangleMesh
    pose: Pose


class TabletopViews:
    """Colour and depth of table-tops as `TabletopScenes` renders them, with what hides what.

    Every item is a model of its own, as sizes differ and cables lie differently. The table itself
    is no object.

    Args:
        scenes: renders them.
        split: name of the split that they are of.
    """

    def __init__(self, scenes: TabletopScenes, split: str = "test") -> None:
        self.scenes, self.split = scenes, split
        self.categories: Sequence[str] = tuple(scenes.classes[1:])

    def __len__(self) -> int:
        """Number of scenes."""
        return len(self.scenes)

    def keys(self, scene: int) -> list[Hashable]:
        """Keys of the items of a scene."""
        return [(scene, i) for i in range(len(self.scenes.scene(scene).items))]

    def objects(self, scene: int) -> tuple[AnnotatedObject, ...]:
        """The items of a scene."""
        return tuple(
            AnnotatedObject((scene, i), part.mesh, part.pose, part.label - 1)
            for i, part in enumerate(self._parts(scene))
        )

    def views(self, scene: int, count: int) -> Iterator[AnnotatedView]:
        """The first `count` views of a scene."""
        objects = self.objects(scene)
        solids = SolidViews([_placed(item) for item in objects])
        for frame in self.scenes.frames(scene, count):
            _, silhouettes = solids.see(frame.camera)
            yield AnnotatedView(frame, objects, tuple(silhouettes))

    def facts(self) -> dict[str, Any]:
        """What decides what they show."""
        return {
            "scenes": [int(number) for number in self.scenes.numbers],
            "items": repr(self.scenes.scene(0).items),
            "split": self.split,
            "seed": self.scenes.seed,
            "camera": repr(self.scenes.camera(0, 0)),
            "renderer": self.scenes.renderer.fingerprint(),
        }

    def _parts(self, scene: int) -> Iterator[_Part]:
        layout = self.scenes.scene(scene)
        geometry = self.scenes.scenes.geometry(layout)
        for number, item in enumerate(layout.items):
            corners = geometry.corners[geometry.item_of == number].astype(np.float64)
            points, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
            turn = rotation_of(item)
            place = np.array([item.x, item.y, item.z])
            mesh = TriangleMesh((points - place) @ turn, faces.reshape(-1, 3).astype(np.int64))
            yield _Part(item.label, mesh, Pose.from_matrix(rigid(turn, place)))


def _name(shape: Shape) -> str:
    """Of the file that a shape is from; empty if it is of none."""
    return shape.name if isinstance(shape, SolidMesh) else ""


def _placed(item: AnnotatedObject) -> TriangleMesh:
    """Its surface in the world."""
    points = item.mesh.vertices @ item.pose.rotation.T + item.pose.position
    return TriangleMesh(points, item.mesh.faces)
