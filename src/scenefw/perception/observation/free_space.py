"""How much of a superquadric lies where a view shows free space."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import binary_erosion

from scenefw.fitting.placed import shape_of

if TYPE_CHECKING:
    from scenefw.core.evidence import FittedSuperquadric
    from scenefw.core.types import Float64
    from scenefw.perception.evidence.gathering import View

SEEN_THROUGH = 0.05
"""Share of an object that may lie where a view shows free space."""
_CORNERS = 6  # of meshes that say where an object is
_SHELLS = (1.0, 0.6, 0.2)  # of its size


def places_in(one: FittedSuperquadric) -> Float64:
    """Places (P, 3) on the surface of a superquadric and inside of it, world (m)."""
    corners = shape_of(one).mesh(_CORNERS).vertices
    inner = np.concatenate([share * corners for share in _SHELLS])
    return np.asarray(inner @ one.pose.rotation.T + one.pose.position, dtype=np.float64)


def seen_through(places: Float64, view: View) -> float:
    """Share of places (..., 3) in the grid that the view shows to be free; 0 if none is in it."""
    voxels, there = view.grid.nearest_voxels(places)
    return float(view.free[tuple(voxels[there].T)].mean()) if there.any() else 0.0


def surely_free(view: View) -> View:
    """The view with free space a voxel away from all that may not be free.

    Beside a surface along which the camera looks, the next voxel is free already; what lies there
    may be an object's rounded edge.
    """
    return replace(view, free=binary_erosion(view.free))
