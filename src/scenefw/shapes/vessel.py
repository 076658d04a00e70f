"""Vessels: hollow bodies of revolution that are open at the top, as bowls, cups and mugs are."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.types import Float64, TriangleMesh
from scenefw.shapes.moments import Moments, moments
from scenefw.shapes.solid_mesh import SolidMesh

_LEVELS = 24  # of a profile
_SECTORS, _AROUND = 16, 3  # of what it collides as; a mesh has three times as many
_STEEPEST = 3.0  # a wall that lies is at most so many times as thick, measured across
_THINNEST = 1e-4  # m
_UNITS = 1024.0  # of a metre, a power of two: coordinates stay the same numbers


@dataclass(frozen=True, eq=False)
class Vessel:
    """A vessel about the z axis, its centre of mass at the origin.

    Outside, its radius at the height t (0 at the bottom, 1 at the rim) is
    `radius * (base + (1 - base) * t**curve)`: a curve of 1 makes cones, of 1/2 bowls, and a base of
    1 cylinders. Inside is the same, a wall further in.

    Args:
        radius: of the rim (m).
        base: radius of the bottom, as a share of that.
        curve: exponent of the radius, see above.
        height: m.
        wall: thickness of the wall and the bottom (m).

    Raises:
        InputError: a number isn't positive, or the wall fills the vessel.
    """

    radius: float
    base: float
    curve: float
    height: float
    wall: float

    def __post_init__(self) -> None:
        numbers = [float(getattr(self, field.name)) for field in fields(self)]
        if not (np.isfinite(numbers).all() and min(numbers) > 0):
            raise InputError(f"vessel {numbers}: expected 5 finite numbers above 0")
        if not self.wall < 0.9 * min(self.radius, self.height):
            raise InputError(
                f"vessel with a wall of {self.wall:.3g} m is solid; expected less than 0.9 of its "
                f"radius {self.radius:.3g} and height {self.height:.3g} m"
            )

    @cached_property
    def outside(self) -> Float64:
        """Profile (K, 2): distance from the axis and height above the bottom, up to the rim (m)."""
        t = np.linspace(0, 1, _LEVELS) ** (1 / min(self.curve, 1.0))
        radii = self.radius * (self.base + (1 - self.base) * t**self.curve)
        return np.concatenate([[[0.0, 0.0]], np.stack([radii, self.height * t], axis=1)])

    @cached_property
    def inside(self) -> Float64:
        """Likewise of the hollow, down from the rim to the axis."""
        z = np.linspace(self.height, self.wall, _LEVELS)
        outer = np.interp(z, *self.outside[1:, ::-1].T)
        slope = np.gradient(outer, z)
        across = self.wall * np.minimum(np.sqrt(1 + slope**2), _STEEPEST)
        radii = np.clip(outer - across, _THINNEST, None)
        return np.concatenate([np.stack([radii, z], axis=1), [[0.0, self.wall]]])

    @property
    def bottom(self) -> float:
        """Height of its lower end in its frame (m), below 0."""
        return -self._moments.pose.position[2]

    def mesh(self, sections: int = _AROUND * _SECTORS) -> TriangleMesh:
        """Its watertight surface.

        Args:
            sections: of a full turn.
        """
        surface = _turned(np.concatenate([self.outside, self.inside]), sections)
        return TriangleMesh(surface.vertices + [0.0, 0.0, self.bottom], surface.faces)

    def filled_mesh(self) -> TriangleMesh:
        """Its surface with a lid on."""
        surface = _turned(np.concatenate([self.outside, [[0.0, self.height]]]), _AROUND * _SECTORS)
        return TriangleMesh(surface.vertices + [0.0, 0.0, self.bottom], surface.faces)

    def volume(self) -> float:
        """Volume of its walls and bottom (m^3)."""
        return self._moments.volume

    def filled_volume(self) -> float:
        """Volume within its outside, up to the rim (m^3)."""
        return moments(self.filled_mesh()).volume

    def solid(self) -> SolidMesh:
        """The same as a mesh that collides as convex pieces of its wall and bottom."""
        mesh = self.mesh()
        return _VesselSolid(mesh.vertices, mesh.faces, self._pieces(), "vessel")

    def scaled(self, factor: float) -> Self:
        """The same shape, larger or smaller."""
        return replace(
            self, radius=self.radius * factor, height=self.height * factor, wall=self.wall * factor
        )

    def filled_distance(self, points: Float64) -> Float64:
        """Distances (...) of points (..., 3) in its frame to it with a lid on (m), inside < 0."""
        flat, height = _in_profile(points - [0.0, 0.0, self.bottom])
        distances = profile_distance(
            np.concatenate([self.outside, [[0.0, self.height]]]), flat, height
        )
        return np.where(self._within(flat, height), -distances, distances)

    def wall_distance(self, points: Float64) -> Float64:
        """Distances (...) of points (..., 3) in its frame to its surface (m), below 0 in walls."""
        half = self.wall / 2
        flat, height = _in_profile(points - [0.0, 0.0, self.bottom])
        return np.asarray(np.abs(self.depth(flat, height) - half) - half)

    def depth(self, flat: Float64, height: Float64) -> Float64:
        """How far (...) places lie within the outside, without a lid (m); outside it, below 0.

        Args:
            flat: (...) distances from the axis (m).
            height: (...) above the bottom (m).
        """
        distances = profile_distance(self.outside, flat, height)
        return np.where(self._within(flat, height), distances, -distances)

    def _within(self, flat: Float64, height: Float64) -> NDArray[np.bool_]:
        low = (height > 0) & (height < self.height)
        return np.asarray(low & (flat < np.interp(height, *self.outside[1:, ::-1].T)))

    def slope(self, height: Float64) -> Float64:
        """By how much the outside widens upward (...), at heights (...) above the bottom (m)."""
        rises = np.diff(self.outside[1:], axis=0)
        places = self.outside[1:-1, 1] + rises[:, 1] / 2
        return np.interp(height, places, rises[:, 0] / rises[:, 1])

    @cached_property
    def _moments(self) -> Moments:
        return moments(_turned(np.concatenate([self.outside, self.inside]), _AROUND * _SECTORS))

    def _pieces(self) -> tuple[Float64, ...]:
        """Corners of convex pieces: the bottom, and each stretch of the wall in each sector."""
        ways = 2 * np.pi * np.arange(_SECTORS + 1) / _SECTORS
        around = np.stack([np.cos(ways), np.sin(ways)], axis=1)
        levels = np.array([0.0, 0.08, 0.25, 0.55, 1.0])
        heights = self.wall + (self.height - self.wall) * levels
        outer = np.interp(heights, *self.outside[1:, ::-1].T)
        inner = np.interp(heights, *self.inside[:-1][::-1, ::-1].T)
        low = self.outside[1, 0]
        floor = np.concatenate([_ring(around, low, 0.0), _ring(around, outer[0], self.wall)])
        pieces = [floor]
        for k in range(len(heights) - 1):
            for j in range(_SECTORS):
                sector = around[j : j + 2]
                pieces.append(np.concatenate([
                    _ring(sector, radius, heights[i])
                    for i in (k, k + 1) for radius in (inner[i], outer[i])
                ]))  # fmt: skip
        return tuple(piece + [0.0, 0.0, self.bottom] for piece in pieces)


@dataclass(frozen=True, eq=False)
class _VesselSolid(SolidMesh):
    """A solid about the z axis, which need not be its longest."""

    def inertia(self) -> Float64:
        """Moments of inertia (3,) about x, y, z per unit mass (m^2)."""
        spread = np.diag(moments(self.mesh()).covariance)
        return np.asarray(spread.sum() - spread)


def profile_distance(profile: Float64, flat: Float64, height: Float64) -> Float64:
    """Distances (...) to a line of K corners (m).

    Args:
        profile: (K, 2) distance from the axis and height.
        flat: (...) distances of the points from the axis.
        height: (...) of the points.
    """
    start, way = profile[:-1], np.diff(profile, axis=0)
    length = np.maximum((way**2).sum(axis=1), 1e-18)
    x, z = flat[..., None] - start[:, 0], height[..., None] - start[:, 1]
    share = np.clip((x * way[:, 0] + z * way[:, 1]) / length, 0, 1)
    squares = (x - share * way[:, 0]) ** 2 + (z - share * way[:, 1]) ** 2
    return np.asarray(np.sqrt(squares.min(axis=-1)))


def _in_profile(points: Float64) -> tuple[Float64, Float64]:
    return np.hypot(points[..., 0], points[..., 1]), points[..., 2]


def _ring(around: Float64, radius: float, height: float) -> Float64:
    return np.column_stack([radius * around, np.full(len(around), height)])


def _turned(profile: Float64, sections: int) -> TriangleMesh:
    """A surface of revolution from a line that begins and ends on the axis."""
    import trimesh

    # trimesh leaves out triangles below 1e-8: in metres also those at a thin wall's end
    mesh = trimesh.creation.revolve(profile * _UNITS, sections=sections)
    faces: NDArray[np.int64] = np.asarray(mesh.faces, np.int64)
    return TriangleMesh(np.asarray(mesh.vertices, np.float64) / _UNITS, faces)
