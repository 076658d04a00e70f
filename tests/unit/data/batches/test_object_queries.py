"""Views for decoders of sets: seen points, and distances to objects."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks
from tests.unit.learning.tiny import views

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.data.batches.object_queries import ObjectQueryViews
from scenefw.data.batches.view_samples import points_of_view
from scenefw.data.batches.visible_points import LOWEST, seen_points
from scenefw.kernels.cameras import stack_cameras
from scenefw.shapes.radial_distance import in_frame, radial_distance

CPU = torch.device("cpu")
SIZES = {"validation_limit": 2, "batch_size": 4, "points": 64, "places": 400}


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return str(tmp_path / "stacks.npz")


def distances(batch, points):
    """(B, M, Q) of points (B, M, Q, 3) to objects."""
    scenes = batch.scenes
    local = in_frame(points, scenes.rotations, scenes.positions)
    axes, exponents = (
        one[:, :, None].expand_as(local) for one in (scenes.half_axes, scenes.exponents)
    )
    return radial_distance(local, axes, exponents)


def test_seen_points_lie_on_objects(stacks):
    batch = ObjectQueryViews(views(48), stacks, **SIZES).training_batch(
        IndexBatch(0, torch.arange(4)), CPU
    )
    assert batch.condition.shape == (4, 2, 48, 48, 48)
    every = batch.points[:, None].expand(-1, batch.scenes.present.shape[1], -1, -1)
    away = torch.where(batch.scenes.present[:, :, None], distances(batch, every).abs(), 9.0)
    assert batch.seen.all()
    assert float(away.amin(dim=1).median()) < 0.004  # images are of a coarse grid
    assert (batch.points[..., 2] > LOWEST).all()


def test_weights_are_told_how_many_points_networks_are_shown(stacks):
    assert points_of_view(ObjectQueryViews(views(48), stacks, **SIZES).facts()) == 64


def test_places_have_their_distances_and_half_of_them_are_near(stacks):
    batch = ObjectQueryViews(views(16), stacks, **SIZES, near=0.005).training_batch(
        IndexBatch(0, torch.arange(4)), CPU
    )
    there = batch.scenes.present
    found = distances(batch, batch.places)
    assert torch.allclose(found[there], batch.distances[there], atol=1e-4)
    near, wide = batch.distances[there].split(200, dim=-1)
    assert float(near.std()) == pytest.approx(0.005, rel=0.1)
    inside = (wide < 0).float().mean(dim=1)
    assert (inside > 0.02).all()
    assert (inside < 0.5).all()
    assert (batch.places[~there] == 0).all()


def test_a_view_depends_on_its_seed_epoch_and_index_alone(stacks):
    data = ObjectQueryViews(views(16), stacks, **SIZES)
    one = data.training_batch(IndexBatch(3, torch.tensor([5])), CPU)
    several = data.training_batch(IndexBatch(3, torch.tensor([1, 5])), CPU)
    other = data.training_batch(IndexBatch(4, torch.tensor([5])), CPU)
    assert torch.allclose(one.points[0], several.points[1], atol=1e-5)
    assert torch.allclose(one.places[0], several.places[1], atol=1e-5)
    assert not torch.allclose(one.points, other.points, atol=1e-3)
    first, again = (data.validation_batch(IndexBatch(e, torch.tensor([0])), CPU) for e in (0, 0))
    assert torch.equal(first.points, again.points)
    assert torch.equal(first.distances, again.distances)


def test_a_view_of_the_bare_floor_shows_no_point():
    camera = Camera(20, 15, 18.0, 18.0, 9.5, 7.0, look_at((0.0, -0.8, 0.6), (0, 0, 0)))
    cameras = stack_cameras([camera])
    grid, chances = GridSpec(16), torch.rand(1, 12)
    v = np.arange(15)[:, None] - 7.0
    rays = np.stack(np.broadcast_arrays((np.arange(20) - 9.5) / 18, v / 18, 1.0), axis=-1)
    down = rays @ camera.T_world_camera[:3, :3].T
    depth = torch.from_numpy(-0.6 / down[..., 2]).float()[None]
    _, seen = seen_points(depth, cameras, grid, chances)
    assert not seen.any()
    _, seen = seen_points(torch.zeros_like(depth), cameras, grid, chances)
    assert not seen.any()
    raised = torch.where(depth > 0, depth * 0.8, depth)
    points, seen = seen_points(raised, cameras, replace(grid), chances)
    assert seen.all()
    assert torch.allclose(points[..., 2], torch.tensor(0.12), atol=1e-5)


def test_numbers_that_mean_nothing_are_refused(stacks):
    for wrong, words in (({"places": 3}, "places = 3"), ({"near": 0.0}, r"near = 0\.0")):
        with pytest.raises(ConfigError, match=words) as caught:
            ObjectQueryViews(views(16), stacks, **wrong)
        assert "\n" not in str(caught.value)
