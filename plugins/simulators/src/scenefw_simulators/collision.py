"""Convex shapes that simulators take for objects."""

from __future__ import annotations

from importlib.util import find_spec

from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.types import TriangleMesh
from scenefw.shapes import convex_parts
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
        convex: an object that fills this share of its convex hull is that hull.
        concavity: of a part at most, as a share of the object's size.
        most: parts of an object at most.
        seed: of the search.

    Raises:
        ConfigError: a number out of range.
        MissingDependencyError: coacd is not installed.
    """

    def __init__(
        self, convex: float = 0.95, concavity: float = 0.05, most: int = 16, seed: int = 0
    ) -> None:
        convex_parts.CONCAVITY.require(concavity=concavity)
        self.division = convex_parts.ConvexParts(convex, concavity, most, seed)
        if find_spec("coacd") is None:
            raise MissingDependencyError(
                "convex parts need coacd: pip install 'scenefw[parts]', or choose "
                "collision=convex_hull"
            )

    def parts(self, mesh: TriangleMesh) -> list[TriangleMesh]:
        """As many as the object needs."""
        return [hull_mesh(part) for part in self.division.of(mesh) or (mesh.vertices,)]
