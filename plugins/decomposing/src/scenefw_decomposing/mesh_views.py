"""Depth images of the surface of a whole scene, as cameras on all sides would take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.types import Float64, Frame, TriangleMesh
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.meshes import Tree
from scenefw.perception.observation.floor import TABLE_HEIGHT
from scenefw.perception.observation.pixels import coarse_step
from scenefw.perception.observation.points import MINORITY, world_points
from scenefw.perception.observation.table_frame import TableFrame
from scenefw_decomposing.upright import HALF_THICKNESS, MAX_HEIGHT, turned_upright

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import Camera
    from scenefw_decomposing.all_sides import Surround

_MAX_RADIUS = 0.55  # m: radius of what cameras try to see, so that they are near enough for a table
_OUTLIER_PERCENTAGE = 0.5  # per cent of vertices at either end that don't say where a scene ends


@dataclass(frozen=True)
class SeenMesh:
    """A mesh on its table, and views of it.

    Args:
        mesh: in table coordinates: z up, table at z = 0.
        T_table_mesh: (4, 4) from coordinates of the mesh as it was given to these.
        frames: with poses in table coordinates.
        note: how the table was found, in words.
    """

    mesh: TriangleMesh
    T_table_mesh: Float64
    frames: tuple[Frame, ...]
    note: str


class MeshViews:
    """Renders a mesh from all sides, with its table as the plane z = 0.

    The table is found in a view from above. A mesh without one stands on its lowest point.

    Args:
        cameras: places the cameras.
        table: finds the table.
    """

    def __init__(self, cameras: Surround, table: TableFrame | None = None) -> None:
        self.cameras, self.table = cameras, table or TableFrame()

    def see(self, mesh: TriangleMesh, name: str) -> SeenMesh:
        """Views of a mesh.

        Args:
            mesh: of a whole scene (m); z up, or with a table that says what is up.
            name: of the scene.

        Raises:
            InputError: nothing stands on the table.
        """
        rotation, turned = turned_upright(mesh)
        R = geometry.rigid(rotation, (0.0, 0.0, 0.0))  # noqa: N806
        mesh = TriangleMesh(geometry.transform_points(R, mesh.vertices), mesh.faces)
        T, note = self._table(mesh, name)  # noqa: N806
        placed_mesh = TriangleMesh(geometry.transform_points(T, mesh.vertices), mesh.faces)
        height = placed_mesh.vertices[:, 2]
        raised_points = placed_mesh.vertices[(height > HALF_THICKNESS) & (height < MAX_HEIGHT)]
        if not len(raised_points):
            raise InputError(
                f"nothing of {name} stands on the table, which is {note}; give a mesh in metres "
                "with z up"
            )
        note = "; ".join(filter(None, (note, turned)))
        frames = _views(placed_mesh, self.cameras.around(*_ball(raised_points)), name, table=True)
        return SeenMesh(placed_mesh, T @ R, tuple(frames), note)

    def _table(self, mesh: TriangleMesh, name: str) -> tuple[Float64, str]:
        """The transform (4, 4) to table coordinates, and how it was found."""
        frames = _views(mesh, self.cameras.around(*_ball(mesh.vertices)), name, table=False)
        alignment = self.table.alignment(frames[-1], posed=True)
        points = np.concatenate([_thinned_points(frame) for frame in frames])
        table_points = geometry.transform_points(
            alignment.T_table_world, points[~np.isnan(points[:, 2])]
        )
        depth_below = -table_points[:, 2]  # of sides of what it is the top of, not a room's floor
        is_below = (depth_below > HALF_THICKNESS) & (depth_below < TABLE_HEIGHT)
        if alignment.table and is_below.mean() < MINORITY:
            return alignment.T_table_world, "a plane of the mesh"
        floor = float(np.percentile(mesh.vertices[:, 2], _OUTLIER_PERCENTAGE))
        return geometry.rigid(np.eye(3), (0.0, 0.0, -floor)), "at the lowest point of the mesh"


def _thinned_points(frame: Frame) -> Float64:
    return world_points(frame, coarse_step(frame.depth.shape[1])).reshape(-1, 3)


def _views(mesh: TriangleMesh, cameras: Sequence[Camera], name: str, *, table: bool) -> list[Frame]:
    tree = Tree(mesh.vertices[mesh.faces].astype(np.float32))
    images = tree.depth(stack_cameras(cameras), table=table).numpy()
    return [
        Frame(image, camera, name=f"{name}, side {number}")
        for number, (image, camera) in enumerate(zip(images, cameras, strict=True), start=1)
    ]


def _ball(points: Float64) -> tuple[Float64, float]:
    """Centre and radius (m) of a ball about nearly all points (N, 3)."""
    low, high = np.percentile(points, [_OUTLIER_PERCENTAGE, 100 - _OUTLIER_PERCENTAGE], axis=0)
    return (low + high) / 2, min(float(np.linalg.norm(high - low)) / 2, _MAX_RADIUS)
