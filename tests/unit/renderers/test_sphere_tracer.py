import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.kernels import analytic

from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.renderers.sphere_tracer import SphereTracer

EYES = st.tuples(st.floats(0, 2 * np.pi), st.floats(0.1, 1.0)).map(
    lambda a: (0.9 * np.cos(a[0]), 0.9 * np.sin(a[0]), a[1])
)
COARSE = GridSpec(resolution=24)


def render(shapes, grid, view, **settings):
    tracer = SphereTracer(**settings)
    return tracer.render(analytic.tsdf(shapes, grid), grid, stack_cameras([view]))[0].numpy()


def meshes_depth(shapes, view):
    """Depth (H, W) of triangle meshes by open3d, without the floor; inf where missed."""
    o3d = pytest.importorskip("open3d", reason="the independent ray caster is open3d")
    scene = o3d.t.geometry.RaycastingScene()
    for shape in shapes:
        if isinstance(shape, analytic.Sphere):
            mesh = o3d.geometry.TriangleMesh.create_sphere(shape.radius, resolution=80)
            mesh.translate(shape.centre)
        else:
            mesh = o3d.geometry.TriangleMesh.create_box(*(2 * np.array(shape.half)))
            mesh.translate(np.array(shape.centre) - shape.half)
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    directions, origin = analytic.pixel_rays(view)  # t_hit counts in lengths of these: z-depth
    rays = np.concatenate([np.broadcast_to(origin, directions.shape), directions], -1)
    rays = rays.astype(np.float32)
    return scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()


@pytest.mark.parametrize(("resolution", "width", "height"), [(32, 160, 120), (64, 320, 240)])
def test_depth_is_that_of_a_mesh_ray_caster(resolution, width, height):
    grid = GridSpec(resolution=resolution)
    view = analytic.camera(width=width, height=height)
    expected = meshes_depth(analytic.SCENE, view)
    depth = render(analytic.SCENE, grid, view, floor=False)
    both = (depth > 0) & np.isfinite(expected)
    assert ((depth > 0) == np.isfinite(expected)).mean() > 0.99
    assert both.mean() > 0.05
    error = np.abs(depth - np.where(both, expected, 0))[both] / grid.voxel_size
    assert np.median(error) < 0.08  # of a voxel: interpolation cuts the ball's curvature
    assert np.quantile(error, 0.97) < 0.5  # and the box's edges


def test_doubling_the_resolution_shrinks_the_error():
    view = analytic.camera()
    exact = analytic.depth([analytic.BALL], view, floor=False).numpy()
    errors = []
    for resolution in (16, 32, 64):
        depth = render([analytic.BALL], GridSpec(resolution=resolution), view, floor=False)
        both = (depth > 0) & (exact > 0)
        errors.append(np.abs(depth - exact)[both].mean())
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[1]


def test_the_floor_reaches_beyond_the_grid():
    view = analytic.camera((1.4, 0.2, 0.3), (0, 0, 0))
    grid = GridSpec(resolution=16)
    depth = render([analytic.BALL], grid, view)
    rays, origin = analytic.pixel_rays(view)
    exact = analytic.depth([analytic.BALL], view).numpy()
    ground = origin + exact[..., None] * rays
    outside = (np.abs(ground[..., :2]).max(-1) > 0.55) & (exact > 0)
    assert outside.mean() > 0.2
    np.testing.assert_allclose(depth[outside], exact[outside], rtol=1e-4)
    # the sky
    np.testing.assert_array_equal(depth[exact == 0], 0)
    assert (exact == 0).any()


def test_without_a_floor_only_objects_are_hit():
    view = analytic.camera()
    depth = render([analytic.BALL], COARSE, view, floor=False)
    exact = analytic.depth([analytic.BALL], view, floor=False).numpy()
    assert (depth[exact == 0] > 0).mean() < 0.01
    assert 0.02 < (depth > 0).mean() < 0.5


def test_a_camera_that_looks_away_sees_nothing():
    view = analytic.camera((0.8, 0, 0.5), (3.0, 0.0, 3.0), 32, 24)
    assert (render([analytic.BALL], COARSE, view) == 0).all()


def test_objects_cut_by_the_cube_are_solid_there():
    wall = analytic.Box((0.45, 0.0, 0.3), (0.2, 0.2, 0.2))  # reaches 15 cm beyond x = 0.5
    view = analytic.camera((1.5, 0.0, 0.3), (0.0, 0.0, 0.3), 64, 48)
    depth = render([wall], GridSpec(resolution=32), view, floor=False)
    assert depth[24, 32] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("resolution", [32, 64])
def test_normals_and_instances(resolution):
    grid, view = GridSpec(resolution=resolution), analytic.camera()
    ball, box = analytic.SCENE
    surface = SphereTracer().render_surface(
        analytic.tsdf(analytic.SCENE, grid),
        analytic.instances(analytic.SCENE, grid),
        grid,
        stack_cameras([view]),
    )
    rays, origin = analytic.pixel_rays(view)
    first = np.stack([shape.hit(origin, rays) for shape in (ball, box)])
    depth, seen = surface.depth[0].numpy(), surface.instances[0].numpy()
    normals = surface.normals[0].permute(1, 2, 0).numpy()
    on_floor = np.isinf(first).all(0) & (rays[..., 2] < 0)
    # away from silhouettes, where a pixel may see another surface than its exact ray
    floor_only = on_floor & (seen == 0)
    assert floor_only.sum() > 0.97 * on_floor.sum()
    np.testing.assert_array_equal(normals[floor_only], [[0, 0, 1]] * floor_only.sum())
    exact = np.minimum(first.min(0), np.where(rays[..., 2] < 0, -origin[2] / rays[..., 2], np.inf))
    same = np.abs(depth - exact) < grid.voxel_size / 2  # silhouettes may show another surface
    for label in (1, 2):
        truth = (first.argmin(0) + 1 == label) & ~on_floor & np.isfinite(first.min(0))
        assert (same & truth).sum() > 0.8 * truth.sum()
        assert (seen == label)[same & truth].mean() > 0.97
    on_ball = seen == 1
    exact = ball.normal(origin + depth[..., None] * rays)[on_ball]
    angle = np.degrees(np.arccos(np.clip((exact * normals[on_ball]).sum(-1), -1, 1)))
    assert np.median(angle) < 0.5
    assert np.quantile(angle, 0.99) < 3
    lengths = np.linalg.norm(normals[seen >= 0], axis=-1)
    np.testing.assert_allclose(lengths, 1, atol=1e-5)
    assert (normals[seen < 0] == 0).all()


def test_nothing_hit_has_label_minus_one():
    view = analytic.camera((0.8, 0, 0.1), (0, 0, 0.3), 64, 48)
    surface = SphereTracer().render_surface(
        analytic.tsdf([analytic.BALL], COARSE),
        analytic.instances([analytic.BALL], COARSE),
        COARSE,
        stack_cameras([view]),
    )
    assert ((surface.instances == -1) == (surface.depth == 0)).all()
    assert (surface.instances == -1).any()


@given(EYES, st.integers(1, 3))
def test_a_quarter_turn_of_scene_and_camera_changes_nothing(eye, quarters):
    view = analytic.camera(eye, width=48, height=36)
    turn = np.linalg.matrix_power(
        np.array([[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), quarters
    )
    volume = analytic.tsdf(analytic.SCENE, COARSE)
    turned = torch.rot90(volume, quarters, (2, 3)).contiguous()
    cameras = stack_cameras([view, view.moved(turn @ view.T_world_camera)])
    depth = SphereTracer().render(torch.cat([volume, turned]), COARSE, cameras)
    error = (depth[0] - depth[1]).abs()
    assert (error > 1e-3).float().mean() < 0.01


@given(EYES)
def test_a_smaller_image_samples_the_larger_one(eye):
    large = analytic.camera(eye, width=96, height=72)
    depth = render(analytic.SCENE, COARSE, large)[1::3, 1::3]
    small = render(analytic.SCENE, COARSE, large.resized(32, 24))
    assert (np.abs(depth - small) > 1e-3 * np.maximum(depth, 1)).mean() < 0.01


@given(EYES)
def test_rendered_points_lie_on_a_surface(eye):
    view = analytic.camera(eye, width=48, height=36)
    depth = render(analytic.SCENE, COARSE, view)
    rays, origin = analytic.pixel_rays(view)
    points = (origin + depth[..., None] * rays)[depth > 0]
    nearest = np.min([shape.distance(points) for shape in analytic.SCENE], axis=0)
    off = np.minimum(np.abs(nearest), np.abs(points[:, 2])) / COARSE.voxel_size
    assert np.quantile(off, 0.95) < 0.3
    assert off.max() < 1.0


def test_scenes_of_a_batch_do_not_meet():
    grid = GridSpec(resolution=20)
    views = [analytic.camera(eye, width=40, height=30) for eye in ((0.8, 0, 0.5), (0, -0.9, 0.3))]
    volumes = [analytic.tsdf([analytic.BALL], grid), analytic.tsdf(analytic.SCENE[1:], grid)]
    together = SphereTracer().render(torch.cat(volumes), grid, stack_cameras(views))
    for i, (volume, view) in enumerate(zip(volumes, views, strict=True)):
        alone = SphereTracer().render(volume, grid, stack_cameras([view]))
        assert torch.equal(together[i], alone[0])


def test_values_that_are_not_finite_count_as_free():
    view = analytic.camera(width=32, height=24)
    volume = torch.full((1, 1, *COARSE.shape), float("nan"))
    depth = SphereTracer(floor=False).render(volume, COARSE, stack_cameras([view]))
    assert (depth == 0).all()


def test_a_volume_of_another_resolution_is_an_error():
    cameras = stack_cameras([analytic.camera()])
    with pytest.raises(InputError, match=r"\(1, 1, 24, 24, 24\)"):
        SphereTracer().render(torch.zeros(1, 1, 16, 16, 16), COARSE, cameras)


def test_a_camera_inside_the_grid_sees_from_where_it_is():
    view = analytic.camera().moved(look_at((0.45, 0.0, 0.2), (0.05, 0.0, 0.16)))
    depth = render([analytic.BALL], GridSpec(resolution=48), view)
    exact = analytic.depth([analytic.BALL], view).numpy()
    assert np.median(np.abs(depth - exact)[exact > 0]) < 1e-3
