import numpy as np
import pytest
import torch

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.mapping.projective import Projective
from scenefw.perception.completion.partial_surface import PartialSurface
from scenefw.perception.observation.observation import Observation
from scenefw.perception.steps import Fits, Objects
from scenefw.postprocessing.connected_components import ConnectedComponents
from scenefw.renderers.sphere_tracer import SphereTracer

CENTRES = np.array([[-0.15, 0, 0.1], [0.15, 0.1, 0.1]])


def balls(grid):
    points = grid.centres()
    fields = [np.linalg.norm(points - centre, axis=-1) - 0.1 for centre in CENTRES]
    return torch.tensor(np.minimum(*fields).clip(-grid.truncation, grid.truncation)).float()


def observed(grid, mapping):
    camera = Camera(160, 120, 145.0, 145.0, 79.5, 59.5, look_at([0.7, -0.6, 0.6], [0, 0, 0.1]))
    cameras = stack_cameras([camera])
    depth = SphereTracer().render(balls(grid)[None, None], grid, cameras)
    return Observation.of_partial(mapping.fuse(depth, grid, cameras), grid)


@pytest.mark.parametrize("mapping", [InverseRayTracing(), Projective()], ids=["rays", "projective"])
@pytest.mark.parametrize("resolution", [32, 64])
def test_partial_surface_shows_the_objects_and_not_the_floor(resolution, mapping):
    grid = GridSpec(resolution=resolution)
    method = PartialSurface(ConnectedComponents())
    view = observed(grid, mapping)
    first, *others = method.complete(Fits(Objects(None)), view, 3, torch.Generator())
    assert [other is first for other in others] == [True, True]
    tsdf, instances = first.objects.tsdf, first.objects.instances
    assert tsdf.shape == instances.shape == grid.shape
    assert (tsdf.dtype, instances.dtype) == (np.float32, np.int32)
    occupied = grid.centres()[tsdf < 0]
    assert len(occupied)
    assert occupied[:, 2].min() > grid.voxel_size
    # All that is occupied is a ball's, or lies behind its seen front.
    outside = np.linalg.norm(occupied[:, None] - CENTRES[None], axis=2).min(axis=1) - 0.1
    assert np.mean(outside < grid.voxel_size) > 0.9
    sizes = np.bincount(instances.ravel())[1:]
    assert sizes[:2].sum() > 0.9 * sizes.sum()  # the rest are specks at silhouettes
    assert sizes[1] > 0.3 * sizes[0]
