"""A fitted superquadric as a shape, and points in its frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.shapes.superquadric import Superquadric

if TYPE_CHECKING:
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64


def shape_of(fitted: FittedSuperquadric) -> Superquadric:
    """Its shape, in its own frame."""
    return Superquadric(fitted.half_axes, fitted.exponents)


def in_frame_of(fitted: FittedSuperquadric, points: Float64) -> Float64:
    """Points (..., 3) of the world in its frame (m)."""
    return np.asarray((points - fitted.pose.position) @ fitted.pose.rotation, dtype=np.float64)
