"""Convex shapes that simulators take for objects."""

from __future__ import annotations

import numpy as np

from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.types import TriangleMesh
from scenefw.shapes.hulls import hull_mesh, thinned_hull


class ConvexHull:
    """One convex hull per object.

    Args:
        tolerance: of how much it may be inside the exact hull, for fewer corners (m).

    Raises:
        ConfigError: a tolerance that isn't positive.
    """

    def __init__(self, tolerance: float = 0.001) -> None:
        if not tolerance > 0:
            raise ConfigError(f"the hulls' tolerance is {tolerance}; expected metres above 0")
        self.tolerance = tolerance

    def parts(self, mesh: TriangleMesh) -> list[TriangleMesh]:
        """The hull alone."""
        return [thinned_hull(mesh.vertices, self.tolerance)]


class ConvexParts:
    """Convex parts by CoACD (Wei et al. 2022): bowls and cups stay hollow.

    Args:
        concavity: of a part at most, as a share of the object's size.
        most: parts of an object at most.
        seed: of the search.

    Raises:
        ConfigError: a number out of range.
        MissingDependencyError: coacd is not installed.
    """

    def __init__(self, concavity: float = 0.05, most: int = 16, seed: int = 0) -> None:
        if not 0.01 <= concavity <= 1 or most < 1:
            raise ConfigError(
                f"concavity is {concavity} and most {most}; expected 0.01 to 1, and at least 1 part"
            )
        try:
            import coacd
        except ImportError as error:
            raise MissingDependencyError(
                "convex parts need coacd: pip install 'coacd>=1', or choose collision=convex_hull"
            ) from error
        coacd.set_log_level("error")
        self.concavity, self.most, self.seed = concavity, most, seed

    def parts(self, mesh: TriangleMesh) -> list[TriangleMesh]:
        """As many as the object needs."""
        import coacd

        found = coacd.run_coacd(
            coacd.Mesh(mesh.vertices, mesh.faces),
            threshold=self.concavity,
            max_convex_hull=self.most,
            seed=self.seed,
        )
        return [hull_mesh(np.asarray(vertices, np.float64)) for vertices, _ in found]
