"""Objects as rigid bodies: mass, inertia, collision shapes, in their own frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Float64, Pose, TriangleMesh
from scenefw.shapes.moments import moments
from scenefw_simulators.collision import ConvexHull

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import CollisionShapes
    from scenefw.core.types import ObjectEstimate, SceneEstimate

DENSITY = 500.0
"""kg/m^3, that of the simulated data."""

_LEAST_VOLUME = 1e-9  # m^3


@dataclass(frozen=True)
class Body:
    """A rigid body; meshes are in its frame, whose origin is the centre of mass.

    Args:
        name: `object_01`, ...
        pose: body to world.
        mesh: what is seen.
        collision: what touches: closed convex meshes.
        mass: kilograms.
        inertia: (3, 3) about the centre of mass (kg m^2).
    """

    name: str
    pose: Pose
    mesh: TriangleMesh
    collision: tuple[TriangleMesh, ...]
    mass: float
    inertia: Float64


class BodyMaker:
    """Makes rigid bodies of the objects of a scene.

    Args:
        density: of every object (kg/m^3).
        collision: says what touches; None = one convex hull each.

    Raises:
        ConfigError: a density that isn't positive.
    """

    def __init__(self, density: float = DENSITY, collision: CollisionShapes | None = None) -> None:
        if not (density > 0 and np.isfinite(density)):
            raise ConfigError(f"density is {density}; expected kg/m^3 above 0")
        self.density = density
        self.collision = collision or ConvexHull()

    def bodies(self, estimate: SceneEstimate) -> Sequence[Body]:
        """One per object.

        Raises:
            InputError: an object has no volume.
        """
        return [self._body(item) for item in estimate.objects]

    def _body(self, item: ObjectEstimate) -> Body:
        body_moments = moments(item.mesh)
        if body_moments.volume < _LEAST_VOLUME:
            raise InputError(
                f"object {item.id} has a volume of {body_moments.volume:.1g} m^3, so no mass; "
                "export GLB, PLY or OBJ instead"
            )
        pose = Pose(body_moments.pose.position, item.pose.quaternion)
        mesh = TriangleMesh((item.mesh.vertices - pose.position) @ pose.rotation, item.mesh.faces)
        mass, spread = self.density * body_moments.volume, moments(mesh).covariance
        return Body(
            f"object_{item.id:02d}",
            pose,
            mesh,
            tuple(self.collision.parts(mesh)),
            mass,
            mass * (np.trace(spread) * np.eye(3) - spread),
        )
