"""USD with physics: a scene for Isaac Sim, Omniverse and whatever else reads UsdPhysics."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.files import replacing
from scenefw.core.types import Pose
from scenefw.export.surface_colours import surface_colours
from scenefw.perception.estimate.base_frame import floor_pose
from scenefw_simulators.bodies import DENSITY, BodyMaker

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.protocols import CollisionShapes
    from scenefw.core.types import Float64, SceneEstimate, TriangleMesh
    from scenefw.export.meshes import Colour
    from scenefw_simulators.bodies import Body

_GRAVITY = 9.81  # m/s^2


class USD:
    """A stage with rigid bodies, in metres and kilograms, z up.

    `/World/object_01` ... are rigid bodies at their poses, with mass and inertia, a mesh with the
    colours of the image, and convex collision shapes that aren't drawn; `/World/obstacle_01` ...
    are meshes that don't move, `/World/Floor` is a plane.

    Args:
        density: of every object (kg/m^3).
        collision: says what touches; None = one convex hull each.

    Raises:
        ConfigError: a density that isn't positive.
        MissingDependencyError: usd-core is not installed.
    """

    suffix = ".usd"

    def __init__(self, density: float = DENSITY, collision: CollisionShapes | None = None) -> None:
        if find_spec("pxr") is None:
            raise MissingDependencyError("USD files need usd-core: pip install 'scenefw[usd]'")
        self._maker = BodyMaker(density, collision)

    def write(self, path: Path, estimate: SceneEstimate, colours: Sequence[Colour]) -> None:
        """Writes the file.

        Raises:
            InputError: an object has no volume.
            StorageError: the file can't be written.
        """
        from pxr import Usd, UsdGeom, UsdPhysics

        stage = Usd.Stage.CreateInMemory()
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
        _add_world(stage, floor_pose(estimate.details))
        paints = surface_colours(estimate, colours)
        for body, paint in zip(self._maker.bodies(estimate), paints, strict=True):
            _add_body(stage, body, paint)
        for number, obstacle in enumerate(estimate.obstacles, start=1):
            mesh = _add_mesh(stage, f"/World/obstacle_{number:02d}", obstacle.mesh)
            _collide(mesh, UsdPhysics.Tokens.none)
        with replacing(path) as temporary:
            stage.Export(str(temporary))


def _add_world(stage: Any, floor: Float64) -> None:
    """Gravity, and a plane to stand on."""
    from pxr import Gf, UsdGeom, UsdPhysics

    scene = UsdPhysics.Scene.Define(stage, "/World/PhysicsScene")
    scene.CreateGravityDirectionAttr(Gf.Vec3f(*(-floor[:3, 2]).tolist()))
    scene.CreateGravityMagnitudeAttr(_GRAVITY)
    plane = UsdGeom.Plane.Define(stage, "/World/Floor")
    plane.CreateAxisAttr(UsdGeom.Tokens.z)
    _place(plane, Pose.from_matrix(floor))
    UsdPhysics.CollisionAPI.Apply(plane.GetPrim())


def _add_body(stage: Any, body: Body, paint: Colour | NDArray[np.float64]) -> None:
    from pxr import Gf, UsdGeom, UsdPhysics

    name = f"/World/{body.name}"
    node = UsdGeom.Xform.Define(stage, name)
    _place(node, body.pose)
    UsdPhysics.RigidBodyAPI.Apply(node.GetPrim())
    mass = UsdPhysics.MassAPI.Apply(node.GetPrim())
    inertia, axes = np.linalg.eigh(body.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    frame = np.eye(4)
    frame[:3, :3] = axes
    mass.CreateMassAttr(body.mass)
    mass.CreateCenterOfMassAttr(Gf.Vec3f(0.0))
    mass.CreateDiagonalInertiaAttr(Gf.Vec3f(*inertia.tolist()))
    mass.CreatePrincipalAxesAttr(Gf.Quatf(*Pose.from_matrix(frame).quaternion.tolist()))
    _paint(_add_mesh(stage, f"{name}/visual", body.mesh), paint)
    for number, part in enumerate(body.collision, start=1):
        mesh = _add_mesh(stage, f"{name}/collision_{number:02d}", part)
        mesh.CreatePurposeAttr(UsdGeom.Tokens.guide)
        _collide(mesh, UsdPhysics.Tokens.convexHull)


def _add_mesh(stage: Any, name: str, mesh: TriangleMesh) -> Any:
    from pxr import UsdGeom, Vt

    node = UsdGeom.Mesh.Define(stage, name)
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float32)
    node.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(vertices))
    faces = np.ascontiguousarray(mesh.faces, dtype=np.int32)
    node.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    node.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(faces), 3, np.int32)))
    node.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    if len(vertices):
        node.CreateExtentAttr([vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()])
    return node


def _paint(node: Any, paint: Colour | NDArray[np.float64]) -> None:
    from pxr import UsdGeom, Vt

    rows = np.ascontiguousarray(np.atleast_2d(paint), dtype=np.float32)
    kind = UsdGeom.Tokens.vertex if len(rows) > 1 else UsdGeom.Tokens.constant
    primvar = node.CreateDisplayColorPrimvar(kind)
    primvar.Set(Vt.Vec3fArray.FromNumpy(rows))


def _collide(node: Any, approximation: str) -> None:
    from pxr import UsdPhysics

    UsdPhysics.CollisionAPI.Apply(node.GetPrim())
    UsdPhysics.MeshCollisionAPI.Apply(node.GetPrim()).CreateApproximationAttr(approximation)


def _place(node: Any, pose: Pose) -> None:
    from pxr import Gf

    node.AddTranslateOp().Set(Gf.Vec3d(*pose.position.tolist()))
    node.AddOrientOp().Set(Gf.Quatf(*pose.quaternion.tolist()))
