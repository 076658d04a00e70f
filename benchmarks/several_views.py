"""A code optimised against six views, beside the same costs by torch's own operations."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from benchmarks.harness import Job
from scenefw.core.batches import CameraBatch, PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes
from scenefw.data.batches.views import ViewMaker
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.perception.completion.volume_network import VolumeNetwork
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_several_views.differentiable import Differentiable, thinned
from scenefw_several_views.optimised_code import OptimisedCode

_VIEWS, _ITERATIONS = 6, 3
_SAMPLES = 64  # of empty space along a ray: steps of 15 mm through the cube


class ByGridSample(Differentiable):
    """The same costs, every place by `grid_sample`, gradients by autograd."""

    def costs(
        self, tsdf: Tensor, grid: GridSpec, depth: Tensor, cameras: CameraBatch
    ) -> tuple[Tensor, Tensor]:
        depth, cameras = thinned(depth, cameras, self.stride)
        surface = tsdf.new_zeros(())
        empty = tsdf.new_zeros(())
        for image, lens, pose in zip(
            depth, cameras.intrinsics, cameras.T_world_camera, strict=True
        ):
            v, u = torch.nonzero(image > 0, as_tuple=True)
            z = image[v, u]
            rays = torch.stack([(u - lens[2]) / lens[0], (v - lens[3]) / lens[1], 0 * z + 1], -1)
            rays = rays @ pose[:3, :3].T
            points = pose[:3, 3] + z[:, None] * rays
            objects = points[:, 2] > self.floor
            surface = surface + _at(tsdf, grid, points[objects]).abs().sum()
            lengths = rays.norm(dim=1)
            steps = self.margin + self.step * torch.arange(_SAMPLES)
            along = z[:, None] - steps / lengths[:, None]
            places = pose[:3, 3] + along[..., None] * rays[:, None]
            empty = empty + _at(tsdf, grid, places.flatten(0, 1)).clamp(max=0).neg().sum()
        known = (depth > 0).sum()
        return surface / known, empty / known


def _at(tsdf: Tensor, grid: GridSpec, points: Tensor) -> Tensor:
    """Interpolated distances at points (P, 3); 0 outside of the grid."""
    voxels = (points - torch.tensor(grid.lower)) / grid.voxel_size - 0.5
    spots = (2 * voxels / (grid.resolution - 1) - 1).flip(-1)[None, :, None, None]
    found: Tensor = grid_sample(tsdf[None, None], spots, align_corners=True)
    return found.flatten()


class _OneObject:
    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        return (tsdf < 0).int(), torch.zeros(1, 3)


def optimised(renderer: type[Differentiable]) -> Callable[[], Callable[[], object]]:
    def setup() -> Callable[[], object]:
        checkpoint: Any = load_checkpoint()
        views = _views(checkpoint.grid)
        network = VolumeNetwork(checkpoint, _OneObject())
        method = OptimisedCode(network, renderer(), iterations=_ITERATIONS)
        code = torch.zeros(1, checkpoint.model.latent_size)
        return lambda: method.optimised(code, views[0], views, checkpoint.grid)

    return setup


def _views(grid: GridSpec) -> list[PartialTSDF]:
    scene = StackScenes(split="val", limit=1).parameters([0])
    maker = ViewMaker(grid, RandomViewpoints(), SphereTracer(), InverseRayTracing())
    return [maker.make_one(scene, np.random.default_rng(k)).partial for k in range(_VIEWS)]


JOBS = [
    Job(
        f"code optimised at 64^3 against {_VIEWS} views 640 x 480, {_ITERATIONS} iterations",
        optimised(Differentiable),
        {"torch grid_sample": optimised(ByGridSample)},
        repeats=3,
    )
]
