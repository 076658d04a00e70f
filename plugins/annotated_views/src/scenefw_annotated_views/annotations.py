"""Views of scenes with all that is known of every object, and what is made of them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from scenefw.core.types import Float64, Frame, Pose, TriangleMesh

Box = tuple[int, int, int, int]
"""First column and row, last column and row, of pixels."""


@dataclass(frozen=True, eq=False)
class AnnotatedObject:
    """An object of a scene.

    Args:
        key: of its model in the data set; objects with the same have the same mesh.
        mesh: in its own frame (m).
        pose: object to world.
        category: position among the categories of the data set.
        symmetries: (K, 3, 3) rotations about its origin that leave it as it is.
    """

    key: Hashable
    mesh: TriangleMesh
    pose: Pose
    category: int
    symmetries: Float64 | None = None


@dataclass(frozen=True, eq=False)
class Silhouette:
    """What of an image an object would cover, and does.

    Args:
        mask: (H, W) bool, pixels of the object, were it alone.
        visible: (H, W) bool, pixels that show it.
        pixels: number of `mask`, and of as many beyond the image as fit into an image of three
            times its sides about it.
        box: of the same pixels; None if there are none.
    """

    mask: NDArray[np.bool_]
    visible: NDArray[np.bool_]
    pixels: int
    box: Box | None

    @property
    def visibility(self) -> float:
        """Share of its pixels that show it."""
        return float(self.visible.sum()) / self.pixels if self.pixels else 0.0


@dataclass(frozen=True, eq=False)
class AnnotatedView:
    """One image of a scene.

    Args:
        frame: depth, camera, and colour where there is one.
        objects: of the scene.
        silhouettes: of each.
        unknown: (H, W) pixels that may show things of which nothing is known; None: none.
    """

    frame: Frame
    objects: tuple[AnnotatedObject, ...]
    silhouettes: tuple[Silhouette, ...]
    unknown: NDArray[np.bool_] | None = None


class AnnotatedScenes(Protocol):
    """Scenes with views and all about their objects (group `views`)."""

    split: str
    """Part of the data that they are of."""
    categories: Sequence[str]
    """Names of kinds of objects."""

    def __len__(self) -> int:
        """Number of scenes."""

    def keys(self, scene: int) -> Sequence[Hashable]:
        """Keys of the objects of a scene, without making their meshes."""

    def objects(self, scene: int) -> tuple[AnnotatedObject, ...]:
        """The objects of a scene."""

    def views(self, scene: int, count: int) -> Iterator[AnnotatedView]:
        """The first `count` views of a scene; view i is always the same."""

    def facts(self) -> Mapping[str, Any]:
        """All that decides what they show, as plain data."""


class DatasetFormat(Protocol):
    """Writes annotated views as a data set (group `format`)."""

    def write_scene(
        self, folder: Path, views: Iterable[AnnotatedView], numbers: Sequence[int]
    ) -> None:
        """Writes a scene into an empty folder.

        Args:
            folder: `ROOT/SPLIT/000000`, by the number of the scene.
            views: of the scene.
            numbers: of the models of its objects, from 1 on.

        Raises:
            StorageError: a file can't be written.
        """

    def finish(self, root: Path, scenes: AnnotatedScenes, numbers: Mapping[Hashable, int]) -> None:
        """Writes what all scenes share, when each has its folder.

        Args:
            root: of the data set.
            scenes: all of them.
            numbers: of models by their keys.

        Raises:
            StorageError: a file can't be written, or one of a scene is damaged.
        """
