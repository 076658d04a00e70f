"""Depth images with the owner of each pixel, made on the fly."""

import numpy as np
import pytest
import torch
from tests.unit.data.stacks_file import write_stacks

from scenefw.core.batches import IndexBatch
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.part_views import PartViews
from scenefw.kernels.cameras import floor_depths, pixel_places
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints

CPU = torch.device("cpu")


@pytest.fixture
def made(tmp_path):
    write_stacks(tmp_path / "stacks.npz")

    def data(**settings):
        plain = dict.fromkeys(("compound", "ends", "tilt", "lift"), 0.0)
        sizes = {"image_size": (64, 48), "validation_limit": 2, "batch_size": 4}
        chosen = {**plain, **sizes, **settings}
        return PartViews(
            RandomViewpoints(), SphereTracer(), GridSpec(64), str(tmp_path / "stacks.npz"), **chosen
        )

    return data


def batch_of(data, *rows, epoch=0):
    return data.training_batch(IndexBatch(epoch, torch.tensor(rows)), CPU)


def test_what_no_object_owns_is_the_floor(made):
    batch = batch_of(made(traced=0.0), 0, 1, 2, 3)
    floor = floor_depths(batch.cameras).view_as(batch.depth)
    bare = (batch.owners == 0) & (batch.depth > 0)
    assert bare.any()
    assert torch.equal(batch.depth[bare], floor[bare])
    assert (batch.depth < floor + 1e-4)[batch.owners > 0].all()
    assert (batch.owners > 0).any(dim=(1, 2)).all()


def test_traced_images_show_the_same_objects_as_exact_ones(made):
    exact, traced = (batch_of(made(traced=t, scale=(1.0, 1.0)), 0, 1, 2, 3) for t in (0.0, 1.0))
    both = (exact.owners > 0) & (traced.owners > 0)
    assert both.sum() > 0.9 * (exact.owners > 0).sum()
    assert (exact.owners == traced.owners)[both].float().mean() > 0.97
    assert (exact.depth - traced.depth)[both].abs().median() < 1e-3


def test_an_image_depends_on_its_seed_epoch_and_index_alone(made):
    data = made(noise={"gaussian": Gaussian(0.002)})
    one, several = batch_of(data, 5, epoch=3), batch_of(data, 1, 5, epoch=3)
    assert torch.equal(one.owners[0], several.owners[1])
    assert torch.allclose(one.depth[0], several.depth[1], atol=1e-5)
    assert not torch.equal(one.owners, batch_of(data, 5, epoch=4).owners)
    index = IndexBatch(0, torch.tensor([0]))
    first, again = (data.validation_batch(index, CPU) for _ in range(2))
    assert torch.equal(first.depth, again.depth)


def test_scenes_become_larger_and_smaller_in_training_alone(made):
    data = made(scale=(0.5, 2.0), traced=0.0)
    pixels = (batch_of(data, 0, epoch=0).owners > 0).sum()
    index = IndexBatch(0, torch.tensor([0]))
    kept = [made(scale=s).validation_batch(index, CPU) for s in ((1.0, 1.0), (0.5, 2.0))]
    assert torch.equal(kept[0].owners, kept[1].owners)
    areas = [(batch_of(data, 0, epoch=e).owners > 0).sum() / pixels for e in range(8)]
    assert np.ptp([float(area) for area in areas]) > 0.1


def test_cups_and_handles_belong_to_their_objects(made):
    plain, changed = (
        batch_of(made(traced=0.0, scale=(1.0, 1.0), compound=c, hollow=0.5, pieces=0.9), *range(8))
        for c in (0.0, 1.0)
    )
    assert changed.owners.max() <= plain.owners.max()
    both = (plain.owners > 0) & (changed.owners == plain.owners)
    assert both.sum() > 0.7 * (plain.owners > 0).sum()
    assert (both & (changed.depth > plain.depth + 0.01)).sum() > 20  # into cups
    assert ((changed.owners > 0) & (plain.owners == 0)).sum() > 20  # second pieces stand out
    traced = [batch_of(made(traced=1.0, compound=c), 0, 1).depth for c in (0.0, 1.0)]
    assert torch.equal(*traced)


def test_tables_end_beyond_objects_and_large_things_are_none(made):
    plain, ended = (
        batch_of(made(traced=0.0, scale=(1.0, 1.0), ends=e), *range(8)) for e in (0.0, 1.0)
    )
    assert torch.equal(ended.depth[plain.owners > 0], plain.depth[plain.owners > 0])
    seen = ended.owners == plain.owners
    assert seen.float().mean() > 0.999
    bare = (plain.owners == 0) & (plain.depth > 0) & (ended.depth > 0)
    heights = pixel_places(ended.depth, ended.cameras)[..., 2]
    assert (heights[bare] < -0.1).float().mean() > 0.02  # the floor below
    assert (heights[bare] > 0.02).sum() > 20  # what stands on it
    assert (heights[bare].abs() < 1e-3).float().mean() > 0.3  # the table
    traced = [batch_of(made(traced=1.0, ends=e), 0, 1).depth for e in (0.0, 1.0)]
    assert torch.equal(*traced)


def test_floors_are_found_a_little_wrong(made):
    data = made(traced=0.0, tilt=0.5, lift=0.004, scale=(1.0, 1.0))
    batches = [batch_of(data, *range(8), epoch=e) for e in range(12)]
    true = [batch_of(made(traced=0.0, scale=(1.0, 1.0)), *range(8), epoch=e) for e in range(12)]
    assert all(torch.equal(a.depth, b.depth) for a, b in zip(batches, true, strict=True))
    moved = torch.cat([
        a.cameras.T_world_camera @ torch.linalg.inv(b.cameras.T_world_camera)
        for a, b in zip(batches, true, strict=True)
    ])  # fmt: skip
    slopes = torch.rad2deg(moved[:, 2, :2])
    assert slopes.std().item() == pytest.approx(0.5, rel=0.2)
    assert moved[:, 2, 3].std().item() == pytest.approx(0.004, rel=0.25)
    assert torch.allclose(moved[:, :3, :3] @ moved[:, :3, :3].mT, torch.eye(3), atol=1e-5)


@pytest.mark.parametrize(
    "wrong",
    [
        {"ends": 1.2},
        {"tilt": -1.0},
        {"traced": 1.5},
        {"compound": -0.1},
        {"scale": (1.3, 1.0)},
        {"image_size": (0, 4)},
    ],
)
def test_bad_settings(made, wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        made(**wrong)


def test_noise_of_poses_is_refused(made):
    with pytest.raises(ConfigError, match="leave out the pose noise tracking"):
        made(noise={"tracking": Jitter()})
