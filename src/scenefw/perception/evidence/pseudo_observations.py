"""A predicted surface as pseudo-observations where an object is hidden."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.fitting.placed import EDGE_POINTS, shape_of

if TYPE_CHECKING:
    from scenefw.core.evidence import Evidence, FittedSuperquadric


def add_predicted_surface(
    evidence: Evidence, predicted: FittedSuperquadric, sigma: float, min_gap: float
) -> Evidence:
    """Visible points, and those of a predicted surface that lie away from them.

    Args:
        evidence: about one object; points that were not measured are left out.
        predicted: the object as a network predicts or samples it.
        sigma: standard deviation of points of its surface (m).
        min_gap: they count if further than this from all visible ones (m).
    """
    visible = evidence.points[evidence.visible]
    surface = shape_of(predicted).mesh(EDGE_POINTS).vertices
    surface = surface @ predicted.pose.rotation.T + predicted.pose.position
    hidden = surface[cKDTree(visible).query(surface)[0] > min_gap]
    return replace(
        evidence,
        points=np.concatenate([visible, hidden]),
        sigmas=np.concatenate([evidence.sigmas[evidence.visible], np.full(len(hidden), sigma)]),
    )
