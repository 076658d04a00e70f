"""Against closed forms, and against volumes that become finer."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec, Pose, SceneObject
from scenefw.kernels.cameras import stack_cameras
from scenefw.renderers.exact_shapes import ExactShapes
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.mesh_volumes import ExactSolids, SolidScenes
from scenefw.representations.volumes import ExactScenes
from scenefw.shapes.superquadric import Superquadric

EYE, RADIUS = np.array([0.5, -0.4, 0.6]), 0.1
CENTRE = np.array([0.05, 0.0, 0.15])
BALL = SceneParameters(
    torch.full((1, 2, 3), RADIUS),
    torch.full((1, 2, 3), 2.0),
    torch.eye(3).expand(1, 2, 3, 3),
    torch.tensor([[CENTRE.tolist(), [0.0, 0.0, 0.0]]], dtype=torch.float32),
    torch.tensor([[True, False]]),
)


def camera(width, target=(0, 0, 0.1)):
    height = width * 3 // 4
    middle = ((width - 1) / 2, (height - 1) / 2)
    return Camera(width, height, 0.8 * width, 0.8 * width, *middle, look_at(EYE, target))


def rays(one):
    """Directions (H, W, 3) of length 1 in depth."""
    v, u = np.indices((one.height, one.width))
    local = np.stack([(u - one.cx) / one.fx, (v - one.cy) / one.fy, np.ones(u.shape)], -1)
    return local @ one.T_world_camera[:3, :3].T


def ball_and_floor(one):
    """Where rays meet the ball, or else the floor."""
    ahead, away = rays(one), EYE - CENTRE
    a, b, c = (ahead**2).sum(-1), 2 * ahead @ away, away @ away - RADIUS**2
    root = b * b - 4 * a * c
    floor = np.where(ahead[..., 2] < 0, -EYE[2] / np.minimum(ahead[..., 2], -1e-9), 0)
    return np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / (2 * a), floor), root


@pytest.mark.parametrize("width", [64, 200])
@pytest.mark.parametrize("resolution", [16, 64])
def test_a_ball_is_round_whatever_the_grid(width, resolution):
    one = camera(width)
    scenes = ExactScenes(BALL, GridSpec(resolution))
    found = ExactShapes(SphereTracer()).render_scenes(scenes, stack_cameras([one]))[0].numpy()
    expected, root = ball_and_floor(one)
    sure = np.abs(root) > 1e-3  # a ray that just touches it may miss
    np.testing.assert_allclose(found[sure], expected[sure], atol=4e-4)


def test_a_floor_is_seen_below_the_horizon_or_left_out():
    level = camera(64, (0, 0, EYE[2]))  # half of the image shows the sky
    scenes, cameras = ExactScenes(BALL, GridSpec(16)), stack_cameras([level])
    found = ExactShapes(SphereTracer()).render_scenes(scenes, cameras)[0].numpy()
    assert (found[: level.height // 2] == 0).all()
    expected, root = ball_and_floor(level)
    low = np.zeros(found.shape, bool)
    low[level.height // 2 :] = True
    low &= np.abs(root) > 1e-3
    np.testing.assert_allclose(found[low], expected[low], rtol=1e-4)
    alone = ExactShapes(SphereTracer(), floor=False).render_scenes(scenes, cameras)[0].numpy()
    assert set(np.unique(alone[root <= 0])) <= {0.0}


@pytest.mark.parametrize("height", [0.005, 0.6])
def test_sky_is_sky_from_any_height(height):
    pose = look_at((0.5, -0.4, height), (0, 0, height))
    low = Camera(64, 48, 50.0, 50.0, 31.5, 23.5, pose)
    scenes = ExactScenes(BALL, GridSpec(16))
    found = ExactShapes(SphereTracer()).render_scenes(scenes, stack_cameras([low]))[0].numpy()
    beside = found[:, :8]  # the ball is in the middle
    assert (beside[:24] == 0).all()
    rows = np.arange(25, 48)
    np.testing.assert_allclose(beside[25:, 0], height * 50 / (rows - 23.5), rtol=1e-3)


def test_volumes_come_nearer_as_they_become_finer():
    cameras = stack_cameras([camera(120)])
    box = SceneParameters(
        BALL.half_axes, torch.full((1, 2, 3), 60.0), BALL.rotations, BALL.positions, BALL.present
    )
    exact = ExactShapes(SphereTracer())
    sharp = exact.render_scenes(ExactScenes(box, GridSpec(16)), cameras)
    apart = []
    for resolution in (24, 48, 96):
        scenes = ExactScenes(box, GridSpec(resolution))
        traced = SphereTracer().render_scenes(scenes, cameras)
        volumes = scenes.volumes
        assert torch.equal(traced, exact.render(volumes.tsdf, scenes.grid, cameras))
        seen = exact.render_surface(volumes.tsdf, volumes.instances, scenes.grid, cameras)
        assert torch.equal(traced, seen.depth)
        apart.append(float((traced - sharp).abs().mean()))
    assert apart[0] > 1.5 * apart[1] > 2 * apart[2] > 0


@pytest.mark.parametrize("width", [64, 160])
def test_meshes_are_seen_as_the_superquadric_they_are_of(width):
    shape = Superquadric([0.1, 0.07, 0.05], [3.0, 2.5, 8.0])
    pose = Pose(CENTRE, np.array([0.8, 0.1, 0.5, 0.3]) / np.linalg.norm([0.8, 0.1, 0.5, 0.3]))
    item = SceneObject(shape, pose, 1.0)
    place = torch.from_numpy(CENTRE[None, None]).float()
    one = SceneParameters(
        torch.tensor([[shape.half_axes.tolist()]]),
        torch.tensor([[shape.exponents.tolist()]]),
        torch.from_numpy(pose.rotation[None, None]).float(),
        place,
        torch.ones(1, 1, dtype=torch.bool),
    )
    cameras = stack_cameras([camera(width)])
    renderer = ExactShapes(SphereTracer(), floor=False)
    grid = GridSpec(16)
    solid = renderer.render_scenes(ExactSolids(SolidScenes(((item,),), place), grid), cameras)
    exact = renderer.render_scenes(ExactScenes(one, grid), cameras)
    both = (solid > 0) & (exact > 0)
    assert ((solid > 0) != (exact > 0)).sum() < 0.05 * both.sum()  # the mesh has flat faces
    assert (solid - exact)[both].abs().median() < 1e-3
    nothing = ExactSolids(SolidScenes(((),), place), grid)
    assert (renderer.render_scenes(nothing, cameras) == 0).all()


def test_chosen_scenes_are_seen_as_alone():
    two = SceneParameters(
        *(
            torch.cat([getattr(BALL, name)] * 2)
            for name in ("half_axes", "exponents", "rotations", "positions", "present")
        )
    )
    two.half_axes[0] *= 0.5
    scenes = ExactScenes(two, GridSpec(16))
    second = scenes.chosen(torch.tensor([1]))
    alone = ExactScenes(BALL, GridSpec(16))
    cameras = stack_cameras([camera(64)])
    assert torch.equal(second.depth(cameras), alone.depth(cameras))
    assert torch.equal(second.volumes.tsdf, alone.volumes.tsdf)
    assert not torch.equal(scenes.chosen(torch.tensor([0])).depth(cameras), alone.depth(cameras))
