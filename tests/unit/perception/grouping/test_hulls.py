"""Hull filling: a box is filled to the floor, and it beats what is not completed at all."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import camera_of, stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.perception.grouping.hulls import HullFilling, _farthest
from scenefw.perception.observation.view_frames import seen_frames
from scenefw.perception.segmentation.crease_segmentation import SeenParts

METHOD = HullFilling(SeenParts(0.01, 0.02, 25.0, 6, 800, grow=False))


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
    partial = Projective().fuse(depth, grid, cameras)
    centres = grid.centres()
    return partial, grid, np.maximum(low - centres, centres - high).max(axis=-1)


def test_a_box_is_filled(seen):
    partial, grid, distance = seen
    first, second = METHOD.complete(partial, grid, 2, None)
    assert second is first
    tsdf, instances = first.tsdf, first.instances
    inside = tsdf[0].numpy() < 0
    assert inside[distance < -0.01].all()  # to a pixel and the margin above the floor
    assert not inside[distance > 0.003].any()
    assert set(np.unique(instances[0].numpy())) == {0, 1}
    assert ((instances[0].numpy() > 0) == inside).all()
    heights = np.flatnonzero(inside.any(axis=(0, 1)))
    assert grid.centres()[0, 0, heights[0], 2] < grid.voxel_size  # down to the floor


def test_parts_that_come_with_the_view_are_filled(seen):
    """Their numbers may have gaps; without them, something has to look for parts."""
    partial, grid, _ = seen
    blind = HullFilling(None)
    with pytest.raises(ConfigError, match="give its setting parts"):
        blind.complete(partial, grid, 1, None)
    found = METHOD.parts.segment(seen_frames(partial, "a test")[0])
    given = replace(partial, parts=torch.from_numpy(np.where(found > 0, 7, 0))[None])
    (scene,), (own,) = blind.complete(given, grid, 1, None), METHOD.complete(partial, grid, 1, None)
    assert torch.equal(scene.tsdf, own.tsdf)
    assert torch.equal(scene.instances, 7 * own.instances)


def test_nothing_lies_in_free_space_or_below_the_floor(seen):
    partial, grid, _ = seen
    tsdf = METHOD.complete(partial, grid, 1, None)[0].tsdf
    free = partial.observed[0, 0] & (partial.distance[0, 0] >= grid.truncation)
    assert (tsdf[0][free] < 0).float().mean() < 0.001
    assert not (tsdf[0][..., grid.centres()[0, 0, :, 2] < 0] < 0).any()


def test_an_empty_floor_is_empty(seen):
    partial, grid, _ = seen
    camera = camera_of(partial.cameras, 0)
    bare = torch.from_numpy(box_depth(camera, np.full(3, 9.0), np.full(3, 9.1)))[None]
    empty = Projective().fuse(bare, grid, partial.cameras)
    (found,) = METHOD.complete(empty, grid, 1, None)
    assert (found.tsdf > 0).all()
    assert not found.instances.any()


def test_distances_are_those_to_the_farthest_plane_of_all():
    rng = np.random.default_rng(3)
    planes = rng.normal(size=(50, 4))
    planes[:, :3] /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    planes[:, 3] = -0.3
    places = rng.uniform(-0.6, 0.6, (4000, 3))
    true = (places @ planes[:, :3].T + planes[:, 3]).max(axis=1)
    assert 500 < (true < 0.2).sum() < 3500
    found = _farthest(planes, places, 0.2)
    assert np.allclose(np.minimum(found, 0.2), np.minimum(true, 0.2), atol=1e-12)


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
    with pytest.raises(InputError, match="depth images"):
        METHOD.complete(PartialTSDF(volume, volume > 0), grid, 1, None)
