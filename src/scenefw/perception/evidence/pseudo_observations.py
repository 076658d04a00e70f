"""What is seen of an object, with a supposed surface where nothing is seen."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.fitting.placed import shape_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.evidence import Evidence, FittedSuperquadric

_CORNERS = 6  # of the mesh of the supposed surface


def with_supposed(
    evidence: Evidence,
    seen: NDArray[np.bool_],
    supposed: FittedSuperquadric,
    sigma: float,
    beyond: float,
) -> Evidence:
    """Seen points, and those of a supposed surface that lie away from them.

    Args:
        evidence: about one object.
        seen: (N,) which of its points are seen; the others are left out.
        supposed: the object as a network predicts or draws it.
        sigma: standard deviation of points of its surface (m).
        beyond: they count if further than this from all seen ones (m).
    """
    surface = shape_of(supposed).mesh(_CORNERS).vertices
    surface = surface @ supposed.pose.rotation.T + supposed.pose.position
    away = surface[cKDTree(evidence.points[seen]).query(surface)[0] > beyond]
    return replace(
        evidence,
        points=np.concatenate([evidence.points[seen], away]),
        sigmas=np.concatenate([evidence.sigmas[seen], np.full(len(away), sigma)]),
    )
