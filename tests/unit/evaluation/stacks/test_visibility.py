import numpy as np
import pytest
import torch

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.evaluation.stacks.visibility import VisibleSurface, visible_share
from scenefw.postprocessing.surfaces import surface
from scenefw.renderers.sphere_tracer import SphereTracer

EYE = np.array([0.9, -0.5, 0.5])
CAMERA = Camera(T_world_camera=look_at(EYE, [0, 0, 0.2]))


def ball(grid, centre, radius):
    field = np.linalg.norm(grid.centres() - centre, axis=-1) - radius
    return torch.tensor(field.clip(-grid.truncation, grid.truncation)).float()


@pytest.mark.parametrize("resolution", [32, 64])
def test_of_a_ball_the_cap_towards_the_camera_is_visible(resolution):
    grid, centre, radius = GridSpec(resolution=resolution), np.array([0, 0, 0.2]), 0.15
    tsdf = ball(grid, centre, radius)
    mesh = surface(tsdf, grid)
    visible = VisibleSurface(SphereTracer()).part(mesh, tsdf, grid, CAMERA)
    distance = np.linalg.norm(EYE - centre)
    # A point sees the cap of a sphere inside its tangent cone.
    assert visible_share(mesh, visible) == pytest.approx(0.5 * (1 - radius / distance), abs=0.03)
    middles = visible.vertices[visible.faces].mean(axis=1) - centre
    cosines = middles @ (EYE - centre) / np.linalg.norm(middles, axis=1) / distance
    assert cosines.min() > radius / distance - 0.2


def test_what_stands_behind_is_hidden():
    grid = GridSpec()
    towards = (EYE - [0, 0, 0.2]) / np.linalg.norm(EYE - [0, 0, 0.2])
    front, back = np.array([0, 0, 0.2]) + 0.15 * towards, np.array([0, 0, 0.2]) - 0.15 * towards
    tsdf = torch.minimum(ball(grid, front, 0.14), ball(grid, back, 0.07))
    mesh = surface(tsdf, grid)
    visible = VisibleSurface(SphereTracer()).part(mesh, tsdf, grid, CAMERA)
    middles = visible.vertices[visible.faces].mean(axis=1)
    assert len(middles)
    assert (np.linalg.norm(middles - back, axis=1) > 0.09).all()
