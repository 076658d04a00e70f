"""Predicted objects as rigid bodies for a simulator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import PlacedShape, SceneObject, TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts
from scenefw.shapes.solid_mesh import SolidMesh, solid
from scenefw.shapes.vessel import Vessel


@dataclass(frozen=True)
class Bodies:
    """Of one scene.

    Args:
        bodies: by label.
        left_out: why an object has none, by label.
    """

    bodies: Mapping[int, SceneObject]
    left_out: Mapping[int, str]

    def divided(self, label: int) -> bool:
        """Whether an object collides as several convex parts."""
        shape = self.bodies[label].shape
        return isinstance(shape, SolidMesh) and len(shape.parts) > 1

    def collides_as(self, label: int) -> str:
        """What an object is to the simulator, in words."""
        shape = self.bodies[label].shape
        if not isinstance(shape, SolidMesh):
            return type(shape).__name__.lower()
        return f"{len(shape.parts)} convex parts" if shape.parts else "convex hull"


class BodyMaker:
    """Makes rigid bodies of uniform density.

    An object that a shape explains is that shape, a vessel as pieces of its wall; another one is
    its mesh, which collides as convex parts, or as its convex hull where it nearly fills that or
    CoACD is not installed.

    Args:
        density: of all objects (kg/m^3).
        parts: divides meshes into convex parts; None: all collide as their convex hulls.

    Raises:
        ConfigError: the density is not positive.
    """

    def __init__(self, density: float = 500.0, parts: ConvexParts | None = None) -> None:
        if not density > 0:
            raise ConfigError(f"density is {density}; expected kg/m^3, above 0")
        self.density, self.parts = density, parts

    def make(self, meshes: Mapping[int, TriangleMesh], placed: Mapping[int, PlacedShape]) -> Bodies:
        """Bodies of objects by label; those without a closed mesh or a volume have none.

        Args:
            meshes: in world coordinates (m).
            placed: the shapes of those objects that have one.
        """
        bodies, left_out = {}, {}
        for label, mesh in sorted(meshes.items()):
            try:
                bodies[label] = self._body(placed.get(label) or self._solid(mesh))
            except InputError as error:
                left_out[label] = str(error)
        return Bodies(bodies, left_out)

    def _solid(self, mesh: TriangleMesh) -> PlacedShape:
        return solid(mesh, self.parts.of if self.parts else None)

    def _body(self, placed: PlacedShape) -> SceneObject:
        shape = placed.shape.solid() if isinstance(placed.shape, Vessel) else placed.shape
        return SceneObject(shape, placed.pose, self.density * shape.volume())
