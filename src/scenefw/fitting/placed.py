"""A fitted superquadric as a shape, and points in its frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.kernels.superquadric_gauge import first_order
from scenefw.shapes.superquadric import Superquadric

if TYPE_CHECKING:
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64


EDGE_POINTS = 6
"""Along each edge of the cube whose mesh says where a superquadric is."""

MIN_HALF_AXIS = 0.004
"""m: of what a depth camera shows."""

SHELLS = (0.9, 0.5)
"""Sizes of copies of a surface, by its own, that say what lies within; objects may touch."""

OUTLIERS = 3.0
"""Standard deviations beyond which a point says less and less, and isn't noise: three sigma."""


def shape_of(fitted: FittedSuperquadric) -> Superquadric:
    """Its shape, in its own frame."""
    return Superquadric(fitted.half_axes, fitted.exponents)


def shells_of(fitted: FittedSuperquadric) -> Float64:
    """Points (P, 3) near its surface and inside of it, in its own frame (m)."""
    surface = shape_of(fitted).mesh(EDGE_POINTS).vertices
    return np.concatenate([share * surface for share in SHELLS])


def in_frame_of(fitted: FittedSuperquadric, points: Float64) -> Float64:
    """Points (..., 3) of the world in its frame (m)."""
    return np.asarray((points - fitted.pose.position) @ fitted.pose.rotation, dtype=np.float64)


def signed_distance(fitted: FittedSuperquadric, points: Float64) -> Float64:
    """Distances (...) of points (..., 3) of the world to its surface (m), of first order."""
    places = np.ascontiguousarray(in_frame_of(fitted, points).reshape(-1, 3))
    distances = np.empty(len(places))
    shape = np.stack([fitted.half_axes, fitted.exponents]).astype(np.float64)
    first_order(len(places), *map(torch.from_numpy, (places, shape, distances)))
    return distances.reshape(points.shape[:-1])


def robust_deviation(fitted: FittedSuperquadric, points: Float64, sigma: float) -> Float64:
    """Squared deviations (...) of points (..., 3) from its surface (Geman and McClure 1987).

    Args:
        fitted: the superquadric.
        points: of the world (m).
        sigma: one standard deviation (m); from `OUTLIERS` of them on, points count less and less.
    """
    squares = (signed_distance(fitted, points) / sigma) ** 2
    return np.asarray(squares / (1 + squares / OUTLIERS**2), dtype=np.float64)
