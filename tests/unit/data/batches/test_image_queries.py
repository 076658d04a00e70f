"""Images for decoders of sets: what they show, and what belongs to them."""

import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.image_queries import ImageQueryViews
from scenefw.data.batches.view_samples import width_of_view
from scenefw.noise.gaussian import Gaussian
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.shapes.radial_distance import in_frame, radial_distance

CPU = torch.device("cpu")
SIZES = {"validation_limit": 2, "batch_size": 4, "places": 40}


def viewpoints():
    return RandomViewpoints(
        640, 480, 579.4, 579.4, 319.5, 239.5, (640, 480), radius=1.0, heights=(0.1, 1.0),
        closest=0.78, centre=(0.0, 0.0, 0.1),
    )  # fmt: skip


@pytest.fixture
def stacks(tmp_path):
    write_stacks(tmp_path / "stacks.npz")
    return str(tmp_path / "stacks.npz")


def data(stacks, **options):
    return ImageQueryViews(viewpoints(), GridSpec(32), stacks, **{**SIZES, **options})


def away_from_objects(batch):
    """Distances (B, P) of seen points to the nearest object (m)."""
    scenes = batch.scenes
    local = in_frame(batch.points[:, None], scenes.rotations, scenes.positions)
    axes, exponents = (
        one[:, :, None].expand_as(local) for one in (scenes.half_axes, scenes.exponents)
    )
    gaps = radial_distance(local, axes, exponents).abs()
    return torch.where(scenes.present[:, :, None], gaps, 9.0).amin(dim=1)


@pytest.mark.parametrize("size", [(128, 96), (64, 64)])
def test_points_lie_on_objects_that_are_told_in_the_same_frame(stacks, size):
    batch = data(stacks, width=size[0]).training_batch(IndexBatch(0, torch.arange(4)), CPU)
    assert batch.condition.shape == (4, 11, size[1], size[0])
    assert batch.points.shape == (4, size[0] * size[1] // 16, 3)
    assert batch.seen.any(dim=1).all()
    assert away_from_objects(batch)[batch.seen].max() < 1e-3
    below = batch.scenes.positions[..., 2][batch.scenes.present]
    assert (below > 0).all()


def test_distances_are_those_of_their_places(stacks):
    batch = data(stacks).validation_batch(IndexBatch(0, torch.arange(2)), CPU)
    scenes = batch.scenes
    local = in_frame(batch.places, scenes.rotations, scenes.positions)
    axes, exponents = (
        one[:, :, None].expand_as(local) for one in (scenes.half_axes, scenes.exponents)
    )
    there = scenes.present
    found = radial_distance(local, axes, exponents)
    assert torch.allclose(found[there], batch.distances[there], atol=1e-4)


def test_noise_moves_points_by_as_much(stacks):
    noisy = data(stacks, noise={"gaussian": Gaussian(0.004)})
    batch = noisy.validation_batch(IndexBatch(0, torch.arange(2)), CPU)
    gaps = away_from_objects(batch)[batch.seen]
    assert 0.0005 < float(gaps.median()) < 0.006
    assert noisy.noise_words != data(stacks).noise_words


def test_a_view_depends_on_its_seed_epoch_and_index_alone(stacks):
    made = data(stacks)
    one = made.training_batch(IndexBatch(3, torch.tensor([5])), CPU)
    several = made.training_batch(IndexBatch(3, torch.tensor([1, 5])), CPU)
    other = made.training_batch(IndexBatch(4, torch.tensor([5])), CPU)
    assert torch.allclose(one.points[0], several.points[1], atol=1e-5)
    assert torch.allclose(one.places[0], several.places[1], atol=1e-5)
    assert not torch.allclose(one.places, other.places, atol=1e-3)


def test_training_scenes_become_larger_and_smaller_and_validation_scenes_do_not(stacks):
    made = data(stacks)
    true = made.validation_scenes.parameters([0, 1], CPU)
    same = made.validation_batch(IndexBatch(0, torch.arange(2)), CPU).scenes
    assert torch.allclose(same.half_axes, true.half_axes)
    factors = []
    for epoch in range(6):
        seen = made.training_batch(IndexBatch(epoch, torch.arange(4)), CPU).scenes
        true = made.scenes.parameters(list(range(4)), CPU)
        ratio = (seen.half_axes / true.half_axes)[true.present]
        factors.append(ratio)
        turns = torch.linalg.det(seen.rotations[true.present])
        assert torch.allclose(turns, torch.ones(()), atol=1e-4)
    factors = torch.cat(factors)
    assert factors.min() > 1 / 1.1501
    assert factors.max() < 1.1501
    assert factors.std() > 0.03


def test_weights_are_told_how_wide_images_are(stacks):
    assert width_of_view(data(stacks, width=64).facts()) == 64
    assert width_of_view({}) == 128


def test_numbers_that_mean_nothing_are_refused(stacks):
    for wrong, words in (
        ({"places": 3}, "places = 3"), ({"near": 0.0}, r"near = 0\.0"), ({"scale": 0.9}, "scale"),
        ({"width": 0}, "width = 0"),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=words) as caught:
            data(stacks, **wrong)
        assert "\n" not in str(caught.value)
