"""Exact volumes of scenes of superquadrics, from parameters, on the device that holds them."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from scenefw.core.batches import CameraBatch, SceneParameters, SceneVolumes
from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.kernels.compile import float32
from scenefw.kernels.scenes import object_voxels, scene_voxels
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.representations.known_scenes import KnownScenes, rows_of


class ExactScenes(KnownScenes[SceneParameters]):
    """B scenes of superquadrics."""

    def computed(self) -> SceneVolumes:
        """Exact distances, votes and instances, see `scene_volumes`."""
        return scene_volumes(self.parameters, self.grid)

    def parameters_of(self, rows: Tensor) -> SceneParameters:
        """Parameters of some of the scenes, by their numbers (N,)."""
        selection: SceneParameters = rows_of(self.parameters, rows)
        return selection

    def depth(self, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres by rays that meet the superquadrics; 0 = nothing hit.

        Raises:
            InputError: as of `scene_volumes`.
        """
        _require_usable(self.parameters)
        return first_hits(self.parameters, cameras)[0]


def scene_volumes(parameters: SceneParameters, grid: GridSpec) -> SceneVolumes:
    """Signed distance, centre votes and instance labels of B scenes, objects alone (no floor).

    The distance is the true one to the surface of eq. 5.1 and the smallest over the objects; a
    voxel is labelled by the object in which it lies deepest.

    Args:
        parameters: B scenes of up to N superquadrics, exponents >= 1.1.
        grid: the voxel grid, world frame.

    Returns:
        Volumes on the device of the parameters, shapes as in `SceneVolumes`.

    Raises:
        InputError: tensors don't fit together, or, looked at on the CPU alone, a present object is
            no convex solid.
    """
    objects = _table(parameters)
    batch, cells = len(objects), grid.resolution**3
    tsdf = objects.new_empty((batch, cells))
    votes = objects.new_empty((batch, 3, cells))
    instances = torch.empty((batch, cells), dtype=torch.int32, device=objects.device)
    spec = grid_numbers(grid)
    scene_voxels(batch * cells, grid.resolution, objects, spec, tsdf, votes, instances)
    return SceneVolumes(
        tsdf.view(batch, 1, *grid.shape),
        votes.view(batch, 3, *grid.shape),
        instances.view(batch, *grid.shape),
    )


def object_occupancy(parameters: SceneParameters, grid: GridSpec) -> Tensor:
    """Whether each voxel centre lies in each object: (B, N, X, Y, Z) bool, False where absent.

    Raises:
        InputError: as of `scene_volumes`.
    """
    objects = _table(parameters)
    batch, count = objects.shape[:2]
    cells = grid.resolution**3
    occupancy = torch.empty((batch, count, cells), dtype=torch.bool, device=objects.device)
    spec = grid_numbers(grid)
    object_voxels(batch * cells, grid.resolution, objects, spec, occupancy)
    return occupancy.view(batch, count, *grid.shape)


def _table(p: SceneParameters) -> Tensor:
    """All objects as rows (B, N, 19); the bounding radius of an absent one is 0."""
    _require_usable(p)
    rotations = p.rotations.flatten(2)
    radius = torch.linalg.vector_norm(p.half_axes, dim=-1)
    columns = [p.half_axes, p.exponents, p.positions, rotations, radius[..., None]]
    table = torch.cat([column.float() for column in columns], dim=-1)
    return torch.where(p.present[..., None], table, torch.zeros_like(table)).contiguous()


def _require_usable(p: SceneParameters) -> None:
    _require_shapes(p)
    if p.present.device.type == "cpu":  # elsewhere, reading values would wait for the device
        require_solids(p)


def _require_shapes(p: SceneParameters) -> None:
    batch = tuple(p.present.shape)
    expected = {
        "half_axes": (*batch, 3),
        "exponents": (*batch, 3),
        "positions": (*batch, 3),
        "rotations": (*batch, 3, 3),
    }
    for name, shape in expected.items():
        actual_shape = tuple(getattr(p, name).shape)
        if len(batch) != 2 or actual_shape != shape:
            raise InputError(
                f"{name} of the scenes has shape {actual_shape}, expected (B, N, ...) = {shape} as "
                f"`present` is {batch}; stack scenes into one batch of equally many objects"
            )


def require_solids(p: SceneParameters) -> None:
    """Raises unless every present object is a valid convex solid.

    Raises:
        InputError: which object is none, and why.
    """
    positive = (p.half_axes > 0) & torch.isfinite(p.half_axes)
    convex = (p.exponents >= 1.1) & torch.isfinite(p.exponents)
    placed = torch.isfinite(p.positions) & torch.isfinite(p.rotations).all(-1)
    bad = p.present & ~(positive & convex & placed).all(-1)
    if bad.any():
        scene, item = bad.nonzero()[0].tolist()
        raise InputError(
            f"object {item} of scene {scene} has half-axes {p.half_axes[scene, item].tolist()}, "
            f"exponents {p.exponents[scene, item].tolist()}, position "
            f"{p.positions[scene, item].tolist()}; expected finite numbers, half-axes > 0 (m) and "
            "exponents >= 1.1: fix it, or mark the object as not present"
        )


def grid_numbers(grid: GridSpec) -> tuple[np.float32, ...]:
    """Lowest corner, voxel size and truncation (m), as kernels take them."""
    return float32(*grid.lower, grid.voxel_size, grid.truncation)
