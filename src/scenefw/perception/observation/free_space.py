"""How much of a superquadric lies where a view shows free space."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.fitting.placed import shells_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64, GridSpec


def places_in(superquadric: FittedSuperquadric) -> Float64:
    """Places (P, 3) near the surface of a superquadric and inside of it, world (m)."""
    return np.asarray(
        shells_of(superquadric) @ superquadric.pose.rotation.T + superquadric.pose.position,
        dtype=np.float64,
    )


def free_ratio(places: Float64, free: NDArray[np.bool_], grid: GridSpec) -> float:
    """Ratio of places (..., 3) in the grid that are free (X, Y, Z); 0 if none is in it."""
    voxels, inside = grid.nearest_voxels(places)
    return float(free[tuple(voxels[inside].T)].mean()) if inside.any() else 0.0
