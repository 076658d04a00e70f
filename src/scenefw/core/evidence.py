"""What views say about an object, and the superquadric that explains it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.types import Float64, Pose


@dataclass(frozen=True, eq=False)
class Evidence:
    """Points that say where an object is and where it isn't.

    Args:
        points: (N, 3) on the surface, world coordinates (m).
        sigmas: (N,) standard deviations of their distance to it (m).
        outside: (M, 3) that the object doesn't contain (m).
        outside_sigmas: (M,) how deep each may lie in it all the same (m).
    """

    points: Float64
    sigmas: Float64
    outside: Float64 = field(default_factory=lambda: np.empty((0, 3)))
    outside_sigmas: Float64 = field(default_factory=lambda: np.empty(0))

    @property
    def visible(self) -> NDArray[np.bool_]:
        """(N,) which points were measured: the surest ones, if any was."""
        return np.asarray(self.sigmas == self.sigmas.min(initial=np.inf))


@dataclass(frozen=True, eq=False)
class FittedSuperquadric:
    """A superquadric where it lies, and how well it explains what it was fitted to.

    Args:
        half_axes: (3,) m.
        exponents: (3,) of eq. 5.1, each >= 1.
        pose: from its frame to the world.
        cost: what the fit made least, per point.
        distances: (N,) of the points to its surface (m), negative inside; may be of first order.
    """

    half_axes: Float64
    exponents: Float64
    pose: Pose
    cost: float
    distances: Float64
