"""Hull filling: a box is filled to the floor, and it beats what is not completed at all."""

import numpy as np
import pytest
import torch
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import camera_of, stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.grouping.hulls import HullFilling, hull_distance
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw.perception.steps import ObjectSet

CREASES = CreaseSegmentation(0.01, 0.02, 25.0, 6, 800, grow=False)


def box_depth(camera, low, high):
    """Depth of an axis-parallel box on the floor z = 0, by the slab method."""
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    local = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)])
    rays = np.einsum("ij,jhw->hwi", camera.T_world_camera[:3, :3], local)
    start = camera.T_world_camera[:3, 3]
    a, b = (low - start) / rays, (high - start) / rays
    near, far = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
    floor = -start[2] / rays[..., 2]
    depth = np.where((near < far) & (near > 0), near, np.where(floor > 0, floor, 0))
    return depth.astype(np.float32)


@pytest.fixture(scope="module", params=[24, 48])
def seen(request):
    grid = GridSpec(resolution=request.param)
    camera = Camera(320, 240, 290.0, 290.0, 159.5, 119.5, look_at((0.6, -0.7, 0.5), (0, 0, 0.1)))
    low, high = np.array([-0.12, -0.1, 0.0]), np.array([0.12, 0.1, 0.2])
    cameras = stack_cameras([camera])
    depth = torch.from_numpy(box_depth(camera, low, high))[None]
    view = Observation.of_partial(Projective().fuse(depth, grid, cameras), grid)
    centres = grid.centres()
    return view, np.maximum(low - centres, centres - high).max(axis=-1)


def test_the_surface_of_an_object_is_its_hull_not_that_of_voxels(seen):
    """Objects are as large as what is visible of them, whatever voxels are."""
    view, _ = seen
    segments = CREASES.segment(view)
    hypothesis = ObjectSet(HullFilling().group(segments, view))
    (scene,) = SceneAssembly().assemble([hypothesis], view, {})
    (item,) = scene.objects
    points = view.points[segments > 0]
    hull = ConvexHull(np.concatenate([points, points * (1, 1, 0)]))
    np.testing.assert_allclose(item.mesh.vertices.min(axis=0), hull.min_bound)
    np.testing.assert_allclose(item.mesh.vertices.max(axis=0), hull.max_bound)
    assert len(item.mesh.vertices) == len(hull.vertices)
    np.testing.assert_allclose(np.sort(item.extents), (0.2, 0.2, 0.24), atol=0.01)


def test_what_a_hypothesis_with_shapes_leaves_is_of_its_volume(seen):
    view, _ = seen
    objects = HullFilling().group(CREASES.segment(view), view)
    (scene,) = SceneAssembly().assemble([ObjectSet(objects, {})], view, {})
    (item,) = scene.objects
    assert len(item.mesh.vertices) != len(objects.meshes[1].vertices)


def test_a_box_is_filled(seen):
    view, distance = seen
    grid, segments = view.grid, CREASES.segment(view)
    objects = HullFilling().group(segments, view)
    assert objects.masks is segments
    inside = objects.tsdf < 0
    assert inside[distance < -0.01].all()  # to a pixel and the margin above the floor
    assert not inside[distance > 0.003].any()
    assert set(np.unique(objects.instances)) == {0, 1}
    assert ((objects.instances > 0) == inside).all()
    heights = np.flatnonzero(inside.any(axis=(0, 1)))
    assert grid.centres()[0, 0, heights[0], 2] < grid.voxel_size  # down to the floor


def test_segments_keep_their_numbers_which_may_have_gaps(seen):
    view, _ = seen
    segments = CREASES.segment(view)
    plain, high = (HullFilling().group(one, view) for one in (segments, 7 * segments))
    np.testing.assert_array_equal(high.tsdf, plain.tsdf)
    np.testing.assert_array_equal(high.instances, 7 * plain.instances)


def test_segments_of_another_segmentation_take_the_place_of_given_ones(seen):
    view, _ = seen
    segments = CREASES.segment(view)
    plain = HullFilling().group(segments, view)
    found = HullFilling(CREASES).group(np.zeros_like(segments), view)
    for name in ("masks", "tsdf", "instances"):
        np.testing.assert_array_equal(getattr(found, name), getattr(plain, name))


def test_nothing_lies_in_free_space_or_below_the_floor(seen):
    view, _ = seen
    tsdf = HullFilling(CREASES).group(None, view).tsdf
    assert (tsdf < 0).any()
    partial = view.partial
    free = (partial.observed & (partial.distance >= view.grid.truncation))[0, 0].numpy()
    assert (tsdf[free] < 0).mean() < 0.001
    assert not (tsdf[..., view.grid.centres()[0, 0, :, 2] < 0] < 0).any()


def test_an_empty_floor_is_empty(seen):
    view, _ = seen
    bare = torch.from_numpy(box_depth(view.camera, np.full(3, 9.0), np.full(3, 9.1)))[None]
    partial = Projective().fuse(bare, view.grid, stack_cameras([view.camera]))
    found = HullFilling(CREASES).group(None, Observation.of_partial(partial, view.grid))
    assert (found.tsdf > 0).all()
    assert not found.masks.any()
    assert not found.instances.any()


@pytest.mark.parametrize("resolution", [24, 48])
def test_distances_are_those_to_the_farthest_plane_of_all(resolution):
    """Of a ball, whose hull with its footprint has many faces."""
    grid = GridSpec(resolution=resolution)
    points = np.random.default_rng(3).normal(size=(150, 3))
    points = 0.15 * points / np.linalg.norm(points, axis=1, keepdims=True) + (0.02, 0.0, 0.2)
    box, distance = hull_distance(points, grid.centres(), grid)
    planes = ConvexHull(np.concatenate([points, points * (1, 1, 0)])).equations
    true = (grid.centres() @ planes[:, :3].T + planes[:, 3]).max(axis=-1)
    reach = grid.truncation
    assert len(np.unique(planes, axis=0)) > 150
    np.testing.assert_allclose(distance, np.clip(true[box], -reach, reach), atol=1e-6)
    assert (distance == np.float32(reach)).any()
    beside = np.ones(grid.shape, dtype=bool)
    beside[box] = False
    assert beside.any()
    assert true[beside].min() >= 0.5 * reach


def test_points_in_one_plane_have_no_hull():
    grid = GridSpec(resolution=24)
    flat = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 3)) * (1, 1, 0)
    assert hull_distance(flat, grid.centres(), grid) is None
    outside = np.random.default_rng(0).uniform(5.0, 5.1, (50, 3))
    assert hull_distance(outside, grid.centres(), grid) is None


def test_cameras_survive_batches():
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    camera = Camera(32, 24, 30.0, 31.0, 15.0, 12.0, turn)
    found = camera_of(stack_cameras([camera]), 0)
    assert np.allclose(found.T_world_camera, turn, atol=1e-6)
    assert (found.width, found.fy) == (32, 31.0)


def test_missing_images_are_named():
    grid = GridSpec(resolution=4)
    volume = torch.ones(1, 1, *grid.shape)
    partial = PartialTSDF(volume, volume > 0)
    with pytest.raises(InputError, match="depth images"):
        HullFilling(CREASES).group(None, Observation.of_partial(partial, grid))
