"""Things of simulated scenes on disk, as rays meet them: planes of their convex parts."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import StorageError
from scenefw.core.files import DAMAGED, replacing, unreadable
from scenefw_things.scenes.scene import OBJECT
from scenefw_things.shapes.part_unions import ball_about, planes_of, surface_points

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from scenefw.core.types import Float64
    from scenefw_things.scenes.scene import ThingItem, ThingScene

_POINTS = 7  # random stream, beside those of the views


@dataclass(frozen=True)
class StoredSolids:
    """All items of scenes, in the order of scenes and labels; items that are no things are empty.

    Args:
        planes: (K, 4) float32, points x with planes[:, :3] @ x + planes[:, 3] <= 0 are inside.
        plane_ends: (P + 1,) int32 of parts, from 0 on.
        balls: (P, 4) float32 centre and radius of a ball about each part (m).
        part_ends: (I + 1,) int32 of items, from 0 on.
        item_ends: (S + 1,) int32 of scenes, from 0 on.
        poses: (I, 4, 4) float64, of items in their scene's world.
        points: (I, N, 3) float32 on the surface of each item, spread evenly (m); N may be 0.
    """

    planes: NDArray[np.float32]
    plane_ends: NDArray[np.int32]
    balls: NDArray[np.float32]
    part_ends: NDArray[np.int32]
    item_ends: NDArray[np.int32]
    poses: Float64
    points: NDArray[np.float32]

    def items(self, scenes: NDArray[np.int64], labels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers of items by scenes and labels, which count from 1."""
        return self.item_ends[scenes].astype(np.int64) + labels - 1

    def parts(self, item: int) -> list[Float64]:
        """Planes (K, 4) of each convex part of an item."""
        rows = range(self.part_ends[item], self.part_ends[item + 1])
        ends = self.plane_ends
        return [self.planes[ends[row] : ends[row + 1]].astype(np.float64) for row in rows]

    @classmethod
    def of(cls, scenes: Iterable[ThingScene], points: int) -> StoredSolids:
        """The items of scenes, with so many points on each surface."""
        planes: list[Float64] = []
        balls: list[Float64] = []
        part_counts, item_counts, poses, surfaces = [0], [0], [], []
        for scene in scenes:
            item_counts.append(len(scene.items))
            for number, item in enumerate(scene.items):
                corners = _corners(item)
                sides = [planes_of(part) for part in corners]
                rng = streams.generator(scene.seed, _POINTS, scene.index, number)
                planes += sides
                balls.extend(ball_about(part) for part in corners)
                part_counts.append(len(corners))
                poses.append(item.pose.matrix)
                surfaces.append(surface_points(corners, sides, points, rng))
        return cls(
            np.concatenate(planes).astype(np.float32),
            np.cumsum([0, *map(len, planes)]).astype(np.int32),
            np.array(balls, dtype=np.float32),
            np.cumsum(part_counts).astype(np.int32),
            np.cumsum(item_counts).astype(np.int32),
            np.array(poses, dtype=np.float64),
            np.array(surfaces, dtype=np.float32),
        )

    def save(self, path: Path) -> None:
        """Writes one file."""
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **{field.name: getattr(self, field.name) for field in fields(self)})

    @classmethod
    def open(cls, path: Path | str) -> StoredSolids:
        """Reads such a file.

        Raises:
            StorageError: there is none, or it is damaged.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                return cls(**{field.name: file[field.name] for field in fields(cls)})
        except (*DAMAGED, OSError, KeyError, TypeError) as error:
            raise StorageError(
                f"{path} holds no solids ({unreadable(error)}); make them with run=render_things"
            ) from error


def _corners(item: ThingItem) -> list[Float64]:
    return [part.corners for part in item.thing.parts] if item.role == OBJECT else []
