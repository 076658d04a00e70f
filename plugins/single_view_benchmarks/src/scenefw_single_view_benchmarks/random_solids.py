"""Random compounds of primitives and random vessels, to calibrate on: none is a real thing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.settings import COUNT, SHARE
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.vessel import Vessel
from scenefw_single_view_benchmarks.mesh_solids import MeshSolids

_MESHES, _LONGEST = "random_urdfs", 20.0  # of pybullet_data; units: nothing there is longer
_EMPTY = "^168/"  # the one of the thousand that holds no triangles
_RIM_RADII = (0.03, 0.09)  # m
_HEIGHT_RATIOS = (0.25, 1.4)  # of a vessel, to the diameter of its rim
_BASES, _CURVES = (0.4, 1.1), (0.35, 1.5)
_WALLS = (0.002, 0.006)  # m


class RandomSolids:
    """Compounds of primitives that come with pybullet, in random sizes, and vessels.

    Compounds collide as their convex hulls: dividing each would take half a minute. Scenes of them
    can belong to any part of a data set.

    Args:
        sizes: smallest and largest longest side of a compound (m).
        steps: sizes between these that there are, evenly spread in their logarithm.
        vessel_ratio: of shapes that are vessels.
        vessels: different ones.
        seed: of the vessels.

    Raises:
        ConfigError: an empty range, or numbers that are out of range.
        MissingDependencyError: pybullet is not installed.
    """

    def __init__(
        self,
        sizes: tuple[float, float] = (0.05, 0.24),
        steps: int = 12,
        vessel_ratio: float = 0.2,
        vessels: int = 100,
        seed: int = 0,
    ) -> None:
        if not 0 < sizes[0] <= sizes[1]:
            raise ConfigError(f"shape.sizes = {sizes}: expected 0 < smallest <= largest (m)")
        SHARE.require(vessel_ratio=vessel_ratio)
        COUNT.require(steps=steps, vessels=vessels)
        self.lengths = np.geomspace(*sizes, steps)
        self.vessel_ratio, self.vessels, self.seed = vessel_ratio, vessels, seed
        self.compounds = MeshSolids(
            _folder(), leave_out=_EMPTY, scale=1 / _LONGEST, longest=1.0, shortest=0.005
        )

    def sample(self, rng: np.random.Generator, split: str | None = None) -> SolidMesh:
        """One shape, whatever part of a data set it is for."""
        del split
        if rng.random() < self.vessel_ratio:
            return self.vessel(int(rng.integers(self.vessels)))
        compound = self.compounds.sample(rng, "test")
        length = float(rng.choice(self.lengths))
        return _scaled(compound, length / float(np.ptp(compound.vertices, axis=0).max()), length)

    def vessel(self, number: int) -> SolidMesh:
        """One of the vessels; always the same for the same number and seed."""
        rng = streams.generator(self.seed, number)
        radius = rng.uniform(*_RIM_RADII)
        height = 2 * radius * rng.uniform(*_HEIGHT_RATIOS)
        base, curve, wall = (rng.uniform(*limits) for limits in (_BASES, _CURVES, _WALLS))
        solid = Vessel(radius, base, curve, height, wall).solid()
        vertices = solid.vertices.astype(np.float32).astype(np.float64)
        return replace(solid, vertices=vertices, name=f"vessel {number}")


def _scaled(solid: SolidMesh, factor: float, length: float) -> SolidMesh:
    """A solid in another size (m), exact in float32, which its name says."""
    vertices = (solid.vertices * factor).astype(np.float32).astype(np.float64)
    return replace(solid, vertices=vertices, name=f"{solid.name} of {1000 * length:.0f} mm")


def _folder() -> str:
    try:
        import pybullet_data
    except ImportError as error:
        raise MissingDependencyError(
            f"random compounds come with pybullet ({error}): pip install 'scenefw[simulation]'"
        ) from error
    return str(Path(pybullet_data.getDataPath()) / _MESHES)
