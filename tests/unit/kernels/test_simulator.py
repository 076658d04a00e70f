"""The CUDA grid, in numba's simulator in a process of its own, equals the CPU's loops."""

import numpy as np
import pytest
import torch
from tests.unit.kernels import analytic

from scenefw.core.types import GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer

GRID = GridSpec(resolution=10)
EYES = ((0.8, 0.3, 0.6), (-0.2, 0.7, 0.9))


def results():
    """Everything that this package's ray kernels compute, by name."""
    views = [analytic.camera(eye, width=12, height=9) for eye in EYES]
    cameras = stack_cameras(views)
    volume = analytic.tsdf(analytic.SCENE, GRID).expand(2, -1, -1, -1, -1)
    labels = analytic.instances(analytic.SCENE, GRID).expand(2, -1, -1, -1)
    surface = SphereTracer().render_surface(volume, labels, GRID, cameras)
    depth = torch.stack([analytic.depth(analytic.SCENE, view) for view in views])
    found = {"depth": surface.depth, "normals": surface.normals, "instances": surface.instances}
    for name, mapping in (("projective", Projective()), ("inverse", InverseRayTracing())):
        partial = mapping.fuse(depth, GRID, cameras)
        found |= {f"{name} distance": partial.distance, f"{name} observed": partial.observed}
    return {name: value.numpy() for name, value in found.items()}


@pytest.fixture(scope="module")
def expected():
    return results()


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("depth", 1e-3),
        ("normals", 2e-2),
        ("instances", 0),
        ("projective distance", 1e-4),
        ("projective observed", 0),
        ("inverse distance", 1e-4),
        ("inverse observed", 0),
    ],
)
def test_the_grid_of_threads_gives_what_the_loop_gives(simulated, expected, name, tolerance):
    wanted, got = expected[name], simulated[name]
    assert got.shape == wanted.shape
    assert len(np.unique(wanted)) > 1
    far = np.abs(got.astype(np.float64) - wanted) > tolerance
    # rounding may put a pixel on the other side of a silhouette or a voxel on that of a border
    assert far.mean() <= 0.01
