"""One thing, or what is none: a family, its parameters and a seed, and what follows from them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.types import Float64, TriangleMesh
from scenefw_things.shapes.distance import signed_distances
from scenefw_things.shapes.families import FAMILIES, OBSTACLES
from scenefw_things.shapes.solids import Part
from scenefw_things.shapes.union import union


@dataclass(frozen=True)
class Thing:
    """A thing as it is stored; equal ones have equal parts, bit for bit.

    Args:
        family: its name.
        parameters: in the order of the family's limits, exact in float32.
        seed: of what no parameter says.
    """

    family: str
    parameters: tuple[float, ...]
    seed: int

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Convex parts, at rest on z = 0 in its usual attitude (m)."""
        kind = (FAMILIES | OBSTACLES)[self.family]
        named = dict(zip(kind.limits, self.parameters, strict=True))
        parts = kind.build(streams.generator(self.seed), **named)
        low = min(float(part.corners[:, 2].min()) for part in parts)
        return tuple(Part(part.corners - (0, 0, low), part.paint) for part in parts)

    @cached_property
    def mesh(self) -> TriangleMesh:
        """The closed surface of the union of its parts."""
        return union([part.corners for part in self.parts])

    def signed_distances(self, points: Float64) -> Float64:
        """Exact distances (N,) of points (N, 3) to its surface (m), negative inside."""
        return signed_distances(points, [part.corners for part in self.parts], self.mesh)

    @property
    def name(self) -> str:
        """Family and a digest of all else."""
        numbers = np.array([*self.parameters, self.seed], dtype=np.float64)
        return f"{self.family}-{hashlib.sha256(numbers.tobytes()).hexdigest()[:12]}"
