"""Superellipsoids (thesis eq. 5.4), which computer vision calls superquadrics."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import beta

from scenefw.core.errors import InputError
from scenefw.core.types import TriangleMesh
from scenefw.shapes.superquadric import cube_lattice, mesh_resolution

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Superellipsoid:
    """((x/a1)^(2/e2) + (y/a2)^(2/e2))^(e2/e1) + (z/a3)^(2/e1) = 1, centred on its centre of mass.

    As printed, eq. 5.4 has 2/e1 for y; the surface of eq. 5.3 has 2/e2 there. For e1 = e2 = e this
    is the superquadric of eq. 5.1 with r = s = t = 2/e, else none.

    Args:
        half_axes: (3,) a1, a2, a3 in metres, > 0.
        e1: shape seen from the side, in (0, 2].
        e2: shape seen from above, in (0, 2].

    Raises:
        InputError: an axis is not positive, or a shape parameter not in (0, 2] (above: not convex).
    """

    half_axes: Array
    e1: float
    e2: float

    def __post_init__(self) -> None:
        axes = np.array(self.half_axes, dtype=np.float64)
        if axes.shape != (3,) or not (np.isfinite(axes).all() and (axes > 0).all()):
            raise InputError(
                f"superellipsoid half_axes = {self.half_axes}: expected 3 finite numbers > 0 (m)"
            )
        for name in ("e1", "e2"):
            if not 0 < getattr(self, name) <= 2:
                raise InputError(
                    f"superellipsoid {name} = {getattr(self, name)}: expected 0 < {name} <= 2 "
                    "(above 2: not convex)"
                )
        axes.flags.writeable = False
        object.__setattr__(self, "half_axes", axes)

    def value(self, points: ArrayLike) -> Array:
        """Left side of eq. 5.4 for points (..., 3) in metres: < 1 inside, 1 on the surface."""
        x, y, z = np.moveaxis(np.abs(np.asarray(points, dtype=np.float64)) / self.half_axes, -1, 0)
        # Scaled by the larger of the two, the sum doesn't underflow for box-like shapes.
        larger, smaller = np.maximum(x, y), np.minimum(x, y)
        ratio = np.divide(smaller, larger, out=np.zeros_like(larger), where=larger > 0)
        across = larger * (1 + ratio ** (2 / self.e2)) ** (self.e2 / 2)
        return across ** (2 / self.e1) + z ** (2 / self.e1)

    def volume(self) -> float:
        """Volume (m^3): 2 a1 a2 a3 e1 e2 B(e1/2 + 1, e1) B(e2/2, e2/2) (Jaklic et al. 2000)."""
        e1, e2 = self.e1, self.e2
        betas = beta(e1 / 2 + 1, e1) * beta(e2 / 2, e2 / 2)
        return float(2 * self.half_axes.prod() * e1 * e2 * betas)

    def mesh(self, resolution: int | None = None) -> TriangleMesh:
        """Watertight surface with 6 x resolution^2 quads, vertices exactly on the shape.

        Args:
            resolution: quads along an edge of the cube; None: `mesh_resolution`.
        """
        lattice, faces = cube_lattice(resolution or mesh_resolution(self.half_axes))
        points = lattice * self.half_axes
        scale = self.value(points) ** (-self.e1 / 2)  # eq. 5.4 is homogeneous of degree 2/e1
        return TriangleMesh(points * scale[:, None], faces)
