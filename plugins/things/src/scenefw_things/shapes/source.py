"""Things as solids that stacks are made of and simulators take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import TriangleMesh
from scenefw.shapes.solid_mesh import SolidMesh, solid
from scenefw_things.shapes.library import ThingLibrary
from scenefw_things.shapes.thing import Thing


class Things:
    """Household things by formula, dealt out to the parts of the data (`library.ThingLibrary`).

    Args:
        families: names of families by part of the data.
        compound_ratio: chance of a compound without a name, where a part lists them.

    Raises:
        ConfigError: an unknown part or family.
    """

    def __init__(self, families: Mapping[str, Sequence[str]], compound_ratio: float = 0.15) -> None:
        self.families, self.compound_ratio = families, compound_ratio
        self.library = ThingLibrary(families, compound_ratio)

    def sample(self, rng: np.random.Generator, split: str) -> SolidMesh:
        """One random thing of a part of the data, in its principal axes, exact in float32."""
        return as_solid(self.library.thing(rng, split))


def as_solid(thing: Thing) -> SolidMesh:
    """A thing in its principal axes, exact in float32; collides as its own convex parts."""
    placed = solid(thing.mesh)
    shape = placed.shape
    to_solid = inverse(placed.pose.matrix)
    parts = tuple(_single(transform_points(to_solid, part.corners)) for part in thing.parts)
    mesh: TriangleMesh = shape.mesh()
    return SolidMesh(_single(mesh.vertices), mesh.faces, parts, thing.name)


def _single(values: np.ndarray) -> np.ndarray:
    return values.astype(np.float32).astype(np.float64)
