"""Views of superquadrics as seen points, made on the fly."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.data.batches.set_flow import SetFlowViews
from scenefw.data.batches.view_samples import ObjectSamples
from scenefw.noise.kinect import Kinect
from scenefw.noise.pose import Jitter
from scenefw.scenes.cameras import RandomViewpoints

CPU = torch.device("cpu")


@pytest.fixture
def data(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return SetFlowViews(
        RandomViewpoints(), str(tmp_path / "stacks.npz"), validation_limit=2, batch_size=4,
        image_size=(48, 36), points=16, along=0.0,
    )  # fmt: skip


def on_surface(batch):
    """Left side of eq. 5.1 at the seen points of seen objects."""
    local = torch.einsum("bnji,bnpj->bnpi", batch.rotations,
                         batch.points - batch.positions[:, :, None])  # fmt: skip
    ratio = local.abs() / batch.half_axes[:, :, None]
    return (ratio ** batch.exponents[:, :, None]).sum(dim=-1)[batch.seen]


def test_points_lie_on_their_objects_in_the_frame_of_the_view(data):
    """Scaled, mirrored and turned, they still do."""
    batch = data.training_batch(IndexBatch(0, torch.arange(6)), CPU)
    assert batch.seen.any()
    assert (on_surface(batch) - 1).abs().max() < 0.02
    assert torch.allclose(torch.linalg.det(batch.rotations[batch.present]), torch.tensor(1.0))
    assert batch.camera[:, 1].abs().max() < 1e-5
    assert (batch.camera[:, 0] < 0).all()
    lowest = batch.points[..., 2][batch.seen].min()
    assert lowest > -0.2  # z is still the world's, up
    assert not (batch.seen & ~batch.present).any()


def test_weights_are_told_what_networks_are_shown(data):
    assert ObjectSamples.of(data.facts()) == ObjectSamples(points=16, ends=48, width=48)


def test_a_view_depends_on_its_seed_epoch_and_index_alone(data):
    one = data.training_batch(IndexBatch(3, torch.tensor([5])), CPU)
    several = data.training_batch(IndexBatch(3, torch.tensor([1, 5])), CPU)
    other = data.training_batch(IndexBatch(4, torch.tensor([5])), CPU)
    assert torch.allclose(one.points[0], several.points[1], atol=1e-5)
    assert not torch.allclose(one.points, other.points, atol=1e-3)
    first, again = (data.validation_batch(IndexBatch(e, torch.tensor([0])), CPU) for e in (0, 0))
    assert torch.equal(first.points, again.points)


def test_scenes_are_mirrored_and_scaled_in_training_alone(data):
    wanted = data.validation_scenes.parameters([0]).half_axes
    kept = data.validation_batch(IndexBatch(0, torch.tensor([0])), CPU)
    assert torch.equal(kept.half_axes, wanted)
    true = data.scenes.parameters([0]).half_axes
    found = [data.training_batch(IndexBatch(e, torch.tensor([0])), CPU) for e in range(6)]
    factors = [float((one.half_axes / true)[0, 0, 0]) for one in found]
    assert np.ptp(factors) > 0.01
    assert 1 / 1.151 < min(factors) < max(factors) < 1.151


def test_numbers_that_mean_nothing_are_refused(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    with pytest.raises(ConfigError, match=r"scale = 0\.5"):
        SetFlowViews(RandomViewpoints(), str(tmp_path / "stacks.npz"), scale=0.5)


def noisy(tmp_path, **settings):
    write_stacks(tmp_path / "stacks.npz")
    return SetFlowViews(
        RandomViewpoints(), str(tmp_path / "stacks.npz"), validation_limit=2, batch_size=4,
        image_size=(96, 72), points=256, along=0.0, **settings,
    )  # fmt: skip


def test_a_depth_camera_moves_points_along_their_rays_and_loses_what_it_sees_at_a_slant(tmp_path):
    plain, disturbed = noisy(tmp_path), noisy(tmp_path, noise={"kinect": Kinect(axial=3.0)})
    rows = IndexBatch(0, torch.arange(6))
    clean, found = (one.training_batch(rows, CPU) for one in (plain, disturbed))
    assert torch.equal(clean.half_axes, found.half_axes)
    assert found.sizes.sum() < clean.sizes.sum()
    both = clean.seen & found.seen
    off = [on_surface(replace(one, seen=both)) for one in (clean, found)]
    assert off[0].sub(1).abs().max() < 0.05
    assert off[1].sub(1).abs().quantile(0.9) > 0.05
    assert torch.isfinite(found.ends).all()


def test_pixels_at_edges_that_read_what_is_behind_are_of_no_object(tmp_path):
    """However far they are shifted, points stay within 2 cm of the surface along their ray."""
    shifted = noisy(tmp_path, noise={"kinect": Kinect(lateral=3.0, axial=0.0, dropout=0.0)})
    batch = shifted.training_batch(IndexBatch(0, torch.arange(6)), CPU)
    local = torch.einsum("bnji,bnpj->bnpi", batch.rotations,
                         batch.points - batch.positions[:, :, None])  # fmt: skip
    outside = (local.abs() - batch.half_axes[:, :, None]).clamp_min(0).norm(dim=-1)
    assert outside[batch.seen].max() < 0.021


def test_poses_are_exact(tmp_path):
    with pytest.raises(ConfigError, match="exact poses"):
        noisy(tmp_path, noise={"pose": Jitter()})
