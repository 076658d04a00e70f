"""Superquadrics |x/a1|^r + |y/a2|^s + |z/a3|^t = 1 (thesis eq. 5.1), convex for exponents >= 1."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln

from scenefw.core.errors import InputError
from scenefw.core.types import TriangleMesh

Array = NDArray[np.float64]

MAX_SAGITTA = 2e-4
"""m, of a mesh's faces inside a ball; at 5e-4, seals of suction cups come out a tenth too low."""

_TINY = 1e-9


@dataclass(frozen=True, eq=False)
class Superquadric:
    """A superquadric centred on its centre of mass, axes along x, y, z.

    Args:
        half_axes: (3,) a1, a2, a3 in metres, > 0.
        exponents: (3,) r, s, t of eq. 5.1, each >= 1 (2, 2, 2: ellipsoid; large: box).

    Raises:
        InputError: an axis is not positive, an exponent is below 1, or a shape is wrong.
    """

    half_axes: Array
    exponents: Array

    def __post_init__(self) -> None:
        for name, minimum in (("half_axes", np.finfo(float).tiny), ("exponents", 1.0)):
            values = getattr(self, name)
            array = np.array(values, dtype=np.float64)
            if array.shape != (3,) or not all(minimum <= v < np.inf for v in array.tolist()):
                bound = "> 0 (metres)" if name == "half_axes" else ">= 1 (below 1: not convex)"
                raise InputError(
                    f"superquadric {name} = {values}: expected 3 finite numbers {bound}"
                )
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def value(self, points: ArrayLike) -> Array:
        """Left side of eq. 5.1 for points (..., 3) in metres: < 1 inside, 1 on the surface."""
        ratio = np.abs(np.asarray(points, dtype=np.float64)) / self.half_axes
        return (ratio**self.exponents).sum(axis=-1)

    def volume(self) -> float:
        """Volume (m^3), Dirichlet's integral; with r = s = t the Beta-function formula."""
        return float(8 * self.half_axes.prod() * _dirichlet(1 / self.exponents, 1 / self.exponents))

    def inertia(self) -> Array:
        """Principal moments of inertia (3,) about x, y, z per unit mass (m^2)."""
        inverse, squares = 1 / self.exponents, np.empty(3)
        for axis in range(3):
            raised = inverse.copy()
            raised[axis] *= 3
            squares[axis] = self.half_axes[axis] ** 2 * _dirichlet(raised, inverse)
        squares /= _dirichlet(inverse, inverse)
        return squares.sum() - squares

    def support(self, directions: ArrayLike) -> Array:
        """Surface points (..., 3) that lie furthest along directions (..., 3), of any length."""
        return support_points(self.half_axes, self.exponents, directions)

    def project(self, directions: ArrayLike) -> Array:
        """Surface points (..., 3) on the rays from the centre along directions (..., 3)."""
        q = np.asarray(directions, dtype=np.float64)
        with np.errstate(divide="ignore"):
            offset = np.log(np.abs(q) / self.half_axes)
        logs = _unit_sum(self.exponents, offset)
        return np.sign(q) * self.half_axes * np.exp(logs / self.exponents)

    def normals(self, points: ArrayLike) -> Array:
        """Outward unit normals (..., 3) at surface points (..., 3)."""
        p = np.asarray(points, dtype=np.float64)
        slope = self.exponents / self.half_axes
        gradient = np.sign(p) * slope * (np.abs(p) / self.half_axes) ** (self.exponents - 1)
        return gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)

    def first_order_distance(self, points: ArrayLike) -> Array:
        """Distance (...) of points (..., 3) to the surface to first order (m), negative inside.

        (1 - 1/g) / |grad ln g| of the gauge g, the factor by which the shape must grow to reach a
        point (Taubin 1991). It is exact on the surface, and on rays through the ends of the axes.
        """
        p = np.asarray(points, dtype=np.float64)
        p = np.where(np.abs(p) < _TINY, _TINY, p)
        q = self.project(p)
        shrunk = np.linalg.norm(q, axis=-1) / np.linalg.norm(p, axis=-1)
        weights = self.exponents * (np.abs(q) / self.half_axes) ** self.exponents
        slope = np.linalg.norm(weights / weights.sum(axis=-1, keepdims=True) / p, axis=-1)
        return (1 - shrunk) / slope

    def mesh(self, resolution: int | None = None) -> TriangleMesh:
        """Watertight surface with 6 x resolution^2 quads, vertices exactly on the superquadric.

        Args:
            resolution: quads along an edge of the cube; None: `mesh_resolution`.
        """
        lattice, faces = cube_lattice(resolution or mesh_resolution(self.half_axes))
        return TriangleMesh(self.project(lattice * self.half_axes), faces)


def support_points(half_axes: ArrayLike, exponents: ArrayLike, directions: ArrayLike) -> Array:
    """Surface points (..., 3) furthest along directions (..., 3), of many superquadrics at once.

    Args:
        half_axes: (..., 3) metres.
        exponents: (..., 3) of eq. 5.1.
        directions: (..., 3) in the frame of each, of any length.
    """
    axes, d = np.asarray(half_axes, dtype=np.float64), np.asarray(directions, dtype=np.float64)
    # Stationarity: |x_i|/a_i = (mu a_i |d_i| / r_i)^(1/(r_i - 1)); log mu makes F = 1. An exponent
    # of 1 has corners and no normals there; 1.001 rounds them by less than 0.1 %.
    powers = np.maximum(np.asarray(exponents, dtype=np.float64), 1.001)
    with np.errstate(divide="ignore"):
        offsets = np.log(np.abs(d) * axes / powers)
    logs = _unit_sum(powers / (powers - 1), offsets)
    return np.sign(d) * axes * np.exp(logs / powers)


def _dirichlet(raised: Array, inverse: Array) -> float:
    """Integral of a monomial over the octant of eq. 5.1 with unit axes (Dirichlet 1839)."""
    logs = gammaln(raised).sum() - gammaln(1 + raised.sum())
    return float(np.exp(logs) * inverse.prod())


def _unit_sum(slopes: Array, offsets: Array) -> Array:
    """Terms t_i = slopes_i (s + offsets_i), (..., 3), with s such that sum exp(t_i) = 1.

    The log of the sum is convex and rises with s, so Newton steps from the right never overshoot.
    """
    # Sums over axes of three numbers are fast where the axis comes first
    b, r = (np.ascontiguousarray(np.moveaxis(np.broadcast_to(a, offsets.shape), -1, 0))
            for a in (offsets, slopes))  # fmt: skip
    s = -b.max(axis=0)
    for _ in range(60):
        terms = np.exp(r * (s + b))
        total = terms.sum(axis=0)
        step = np.log(total) * total / (r * terms).sum(axis=0)
        s = s - step
        if np.abs(step).max(initial=0.0) < 1e-13:
            break
    return np.moveaxis(r * (s + b), 0, -1)


def mesh_resolution(half_axes: Array) -> int:
    """Quads along an edge that keep a ball as large as a shape to `MAX_SAGITTA`.

    Spaces of `cube_lattice` are widest in the middle of a face, 3 pi / 4 of a radius over the
    resolution; a diagonal of that has a sagitta of its square over 8 radii.
    """
    return math.ceil(3 * math.pi / 8 * math.sqrt(float(half_axes.max()) / MAX_SAGITTA))


@lru_cache(maxsize=64)
def cube_lattice(resolution: int) -> tuple[Array, NDArray[np.int64]]:
    """Vertices (V, 3) on the cube [-1, 1]^3 and faces (F, 3), closed and outward.

    Raises:
        InputError: the resolution is below one.
    """
    if resolution < 1:
        raise InputError(f"mesh resolution = {resolution}: expected at least 1")
    i, j = np.meshgrid(np.arange(resolution), np.arange(resolution), indexing="ij")
    corners = [np.stack([i + a, j + b], axis=-1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    quads = []
    for axis in range(3):
        for side in (0, resolution):
            ring = corners if side else corners[::-1]
            quad = np.stack([np.insert(c, 0, side, axis=-1) for c in ring], axis=2)
            quads.append(np.roll(quad, axis, axis=-1).reshape(-1, 4, 3))
    keys, index = np.unique(np.concatenate(quads).reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    faces = np.concatenate([index[:, [0, 1, 2]], index[:, [0, 2, 3]]]).astype(np.int64)
    # Between even angles (good for balls) and crowded at the edges (good for boxes).
    t = keys * (2.0 / resolution) - 1
    vertices = (np.tan(np.pi / 4 * t) + np.sin(np.pi / 2 * t)) / 2
    return vertices, faces
