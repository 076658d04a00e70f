"""Surfaces of objects as triangles, for pictures that are sharper than voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor

from scenefw.kernels import drawn_surfaces
from scenefw.kernels.compile import float32
from scenefw.kernels.corner_normals import corner_normals
from scenefw.kernels.meshes import Tree

if TYPE_CHECKING:
    from collections.abc import Mapping

    from scenefw.core.types import Camera, Float32, Int32, TriangleMesh

_SMOOTH = float(np.cos(np.radians(35)))  # faces that meet at less than this look round


class Met(NamedTuple):
    """What rays meet first.

    Attributes:
        depth: (N,) metres, 0 where that is nothing.
        facing: (N, 3) normals; those of inner surfaces look at the camera.
        labels: (N,) int32, 0 = the floor z = 0 or nothing.
    """

    depth: Tensor
    facing: Tensor
    labels: Tensor


class Surfaces:
    """Meshes that rays meet first.

    Args:
        meshes: in world coordinates (m), by label.
    """

    def __init__(self, meshes: Mapping[int, TriangleMesh]) -> None:
        corners = [mesh.vertices[mesh.faces] for mesh in meshes.values()]
        normals = [corner_normals(mesh.vertices, mesh.faces, _SMOOTH) for mesh in meshes.values()]
        labels = [np.full(len(mesh.faces), label) for label, mesh in meshes.items()]
        self._tree = Tree(np.concatenate([np.empty((0, 3, 3)), *corners]).astype(np.float32))
        order = self._tree.order
        of_corners = np.concatenate([np.empty((0, 3, 3)), *normals])[order]
        self._normals = torch.from_numpy(of_corners.reshape(-1, 9).astype(np.float32))
        owners = np.concatenate([np.empty(0, int), *labels])[order]
        self._labels = torch.from_numpy(owners.astype(np.int32))

    def seen_from(self, camera: Camera) -> tuple[Float32, Float32, Int32]:
        """z-depth (H, W) in metres, normals (H, W, 3) and labels (H, W) of what pixels show.

        Depth 0 is nothing, label 0 the floor z = 0 or nothing. Normals of inner surfaces look at
        the camera.
        """
        met = self.met(camera, pixel_places(camera))
        shape = (camera.height, camera.width)
        return (
            met.depth.view(shape).numpy(),
            met.facing.view(*shape, 3).numpy(),
            met.labels.view(shape).numpy(),
        )

    def met(self, camera: Camera, places: Tensor) -> Met:
        """The same of rays through places (N, 2) of the image, see `pixel_places`."""
        count, tree = len(places), self._tree
        hits = Met(torch.empty(count), torch.empty(count, 3), torch.empty(count, dtype=torch.int32))
        drawn_surfaces.meet(
            count, places, view_of(camera), tree.bounds, tree.links, tree.triangles,
            self._normals, self._labels, hits.depth, hits.facing, hits.labels,
        )  # fmt: skip
        return hits


def pixel_places(camera: Camera) -> Tensor:
    """Columns and rows (H W, 2) of the middles of all pixels, row by row."""
    rows, columns = (torch.arange(n, dtype=torch.float32) for n in (camera.height, camera.width))
    return torch.cartesian_prod(rows, columns).flip(1).contiguous()


def view_of(camera: Camera) -> tuple[np.float32, ...]:
    """A camera as kernels of `drawn_surfaces` take it."""
    pose = camera.T_world_camera
    lens = (camera.fx, camera.fy, camera.cx, camera.cy)
    return float32(*pose[:3, 3], *pose[:3, :3].ravel(), *lens)
