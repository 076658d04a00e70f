"""Solids of objects whose rays are known: where each enters, leaves, and passes a hollow."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt, label
from skimage.measure import marching_cubes
from torch.nn import functional

from scenefw.core.types import TriangleMesh

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.types import Camera, Float64

    Mask = NDArray[np.bool_]

ENTRY, EXIT, GAP_START, GAP_END = range(4)
"""Depths of a shell: where a ray enters, leaves, and between both, what it passes of a hollow."""

_MIN_DEPTH = 1e-6  # m: places behind the camera are before it
_MIN_VOXEL = 0.003  # m: finer ones show the noise of depth cameras alone
_MARGIN = 2  # voxels about a mesh's box, so that it is closed
_TAUBIN_STEPS = 20  # leave 0.03 % of bumps 3 voxels wide and 96 % of those 10 wide
_TAUBIN_INFLATION = 0.53  # after each shrinking by 0.5, as Taubin has it: volumes stay
_CLEARANCE = 1e-3  # of a voxel: a field of 0 in a voxel gives faces without area


@dataclass(frozen=True)
class Foot:
    """The lower end of a solid, stretched so that it stands on something.

    Args:
        support: height of what it stands on (m).
        bottom: height at which it ended (m).
        top: height from which on it is as it was (m), above both.
    """

    support: float
    bottom: float
    top: float

    def stretched(self, heights: Float64) -> Float64:
        """Where heights (...) of the solid as it was go."""
        return self._scaled(heights, (self.top - self.support) / (self.top - self.bottom))

    def unstretched(self, heights: Float64) -> Float64:
        """The inverse of `stretched`."""
        return self._scaled(heights, (self.top - self.bottom) / (self.top - self.support))

    def _scaled(self, heights: Float64, factor: float) -> Float64:
        below = np.minimum(heights - self.top, 0.0)
        return heights + below * (factor - 1)


@dataclass(frozen=True, eq=False)
class ObjectShell:
    """The shell of one object (Chavan-Dafle et al. 2020), with the gaps of hollow ones.

    Args:
        camera: of R x R pixels, above the floor z = 0.
        amodal: (R, R) rays that meet the object.
        hollow: (R, R) rays that leave it and enter it again.
        depths: (4, R, R) z-depth (m) of ENTRY, EXIT, GAP_START and GAP_END; entry and exit matter
            where `amodal`, the others where `hollow`.
        foot: its lower end, if that goes on further down than rays say.
    """

    camera: Camera
    amodal: Mask
    hollow: Mask
    depths: Float64
    foot: Foot | None = None

    def signed_distance(self, places: Float64) -> Float64:
        """Distance (...) of places (..., 3) to the surface (m), negative inside.

        The larger one of that along the ray and that across it; no place below the floor is inside.
        """
        camera, shape = self.camera, places.shape[:-1]
        if self.foot is not None:
            heights = self.foot.unstretched(places[..., 2])
            places = np.concatenate([places[..., :2], heights[..., None]], axis=-1)
        pose = torch.from_numpy(camera.T_world_camera).float()
        world = torch.from_numpy(np.ascontiguousarray(places, np.float32)).reshape(-1, 3)
        local = (world - pose[:3, 3]) @ pose[:3, :3]
        z = local[:, 2].clamp_min(_MIN_DEPTH)
        column = local[:, 0] / z * camera.fx + camera.cx
        row = local[:, 1] / z * camera.fy + camera.cy
        last = self.amodal.shape[0] - 1
        grid = torch.stack([column, row], dim=1) * (2 / last) - 1
        values = functional.grid_sample(
            self._fields[None], grid[None, None], padding_mode="border", align_corners=True
        )
        entry, end, gap_start, gap_end, beside, beside_gap = values[0, :, 0]
        for pixel in (column, row):  # the image ends
            beside = torch.maximum(beside, (pixel - last / 2).abs() - last / 2)
        width = z / camera.fx
        distance = torch.maximum(entry - z, z - end)
        distance = torch.maximum(distance, torch.maximum(beside * width, -world[:, 2]))
        if self.hollow.any():
            in_gap = torch.maximum(gap_start - z, z - gap_end)
            distance = torch.maximum(distance, -torch.maximum(in_gap, beside_gap * width))
        return distance.reshape(shape).double().numpy()

    @cached_property
    def _fields(self) -> Tensor:
        """(6, R, R): depths that go on beside their rays, and distances (pixels) to these."""
        depths = self.depths.astype(np.float64)
        solid = _extended(depths[[ENTRY, EXIT]], self.amodal)
        hollow = _extended(depths[[GAP_START, GAP_END]], self.hollow)
        beside = [_distance(self.amodal), _distance(self.hollow)]
        return torch.from_numpy(np.stack([*solid, *hollow, *beside])).float()

    @property
    def pixel(self) -> float:
        """Width of a pixel at the object (m)."""
        return float(np.median(self.depths[ENTRY][self.amodal]) / self.camera.fx)

    @property
    def voxel(self) -> float:
        """Side of the voxels of its mesh (m): a pixel there, but no finer than noise."""
        return max(self.pixel, _MIN_VOXEL)

    def places(self) -> Float64:
        """Points (P, 3) where all rays that meet it enter and leave it, in the world."""
        camera, (v, u) = self.camera, np.nonzero(self.amodal)
        directions = np.ones((len(u), 3))
        directions[:, 0] = (u - camera.cx) / camera.fx
        directions[:, 1] = (v - camera.cy) / camera.fy
        depths = self.depths[[ENTRY, EXIT]][:, v, u].ravel()[:, None]
        local = np.tile(directions, (2, 1)) * depths
        places = local @ camera.T_world_camera[:3, :3].T + camera.T_world_camera[:3, 3]
        if self.foot is not None:
            places[:, 2] = self.foot.stretched(places[:, 2])
        return places

    def mesh(self, voxel: float) -> TriangleMesh | None:
        """The closed surface of its largest piece; None without volume.

        By marching cubes, then without bumps of the size of voxels (Taubin 1995).

        Args:
            voxel: side of those of its grid (m).
        """
        from trimesh import Trimesh
        from trimesh.smoothing import filter_taubin, laplacian_calculation

        places = self.places()
        if not len(places):
            return None
        low = places.min(axis=0) - _MARGIN * voxel
        shape = np.ceil((places.max(axis=0) - low) / voxel).astype(int) + _MARGIN + 1
        grid = np.moveaxis(np.indices(shape), 0, -1) * voxel + low
        field = self.signed_distance(grid) / voxel
        pieces, count = label(field < 0)
        if not count:
            return None
        sizes = np.bincount(pieces.ravel())
        sizes[0] = 0
        field = np.where((pieces > 0) & (pieces != sizes.argmax()), _CLEARANCE, field)
        field = np.where(np.abs(field) < _CLEARANCE, np.copysign(_CLEARANCE, field), field)
        field = np.pad(field.clip(-1, 1), 1, constant_values=1.0)
        vertices, faces, _, _ = marching_cubes(field, 0.0)
        body = Trimesh((vertices - 1) * voxel + low, faces.astype(np.int64), process=False)
        lowest = body.vertices[:, 2].min()
        by_rows = laplacian_calculation(body).tocsr()  # multiplied faster than what trimesh makes
        filter_taubin(
            body, nu=_TAUBIN_INFLATION, iterations=_TAUBIN_STEPS, laplacian_operator=by_rows
        )
        smooth = np.array(body.vertices)
        smooth[:, 2] = smooth[:, 2].clip(min=lowest)  # above the floor
        return TriangleMesh(smooth, np.asarray(body.faces))


def _distance(mask: Mask) -> Float64:
    """Signed distance (R, R; pixels) to where a mask ends, negative inside."""
    if not mask.any():
        return np.full(mask.shape, float(max(mask.shape)))
    inside = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    outside = distance_transform_edt(~mask)
    return np.asarray(np.where(mask, 0.5 - inside, outside - 0.5))


def _extended(values: Float64, mask: Mask) -> Float64:
    """Values (K, R, R) that beside a mask are those of its nearest pixel."""
    if not mask.any():
        return values
    rows, columns = distance_transform_edt(~mask, return_distances=False, return_indices=True)
    return values[:, rows, columns]
