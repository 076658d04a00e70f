import numpy as np
import pytest
import torch
from tests.unit.representations import reference

from scenefw.core.batches import PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.data.batches.conditioning import condition, shape_instance_batch
from scenefw.representations import volumes
from scenefw.representations.occupancy import Occupancy
from scenefw.representations.tsdf import TSDF
from scenefw.representations.volumes import ExactScenes
from scenefw.representations.vote_field import VoteField


@pytest.mark.parametrize("resolution", [8, 16])
def test_condition_is_in_truncations_with_what_was_observed(resolution):
    grid = GridSpec(resolution)
    rng = np.random.default_rng(0)
    distance = rng.uniform(-1.2, 1.2, (2, 1, *grid.shape)).astype(np.float32) * grid.truncation
    observed = rng.random((2, 1, *grid.shape)) < 0.5
    partial = PartialTSDF(torch.from_numpy(distance), torch.from_numpy(observed))
    with_observed = condition(partial, grid)
    expected = np.clip(distance / grid.truncation, -1, 1)
    np.testing.assert_allclose(with_observed[:, :1], expected, atol=1e-6)
    np.testing.assert_array_equal(with_observed[:, 1:], observed.astype(np.float32))


BALL = reference.one_object((0.2, 0.2, 0.2), (2, 2, 2), position=(0, 0, 0.2))


def test_targets_are_in_units_of_the_network_and_truths_in_their_own():
    grid = GridSpec(8)
    tsdf = torch.full((1, 1, *grid.shape), grid.truncation / 2)
    partial = PartialTSDF(tsdf, torch.ones_like(tsdf, dtype=torch.bool))
    scenes = ExactScenes(BALL, grid)
    made = {"tsdf": TSDF(), "occupancy": Occupancy()}
    batch = shape_instance_batch(partial, scenes, made, truths=True)
    assert float(batch.tsdf.max()) == 1
    torch.testing.assert_close(batch.tsdf * grid.truncation, scenes.volumes.tsdf)
    assert torch.equal(batch.truths["tsdf"], scenes.volumes.tsdf)
    assert torch.equal(batch.targets["occupancy"] > 0.5, batch.tsdf < 0)
    assert batch.truths["occupancy"].dtype == torch.bool
    assert shape_instance_batch(partial, scenes, made).truths == {}
    assert float(batch.condition[:, :1].max()) == pytest.approx(0.5)


def test_volumes_of_several_representations_are_computed_once(monkeypatch):
    calls = []
    compute = volumes.scene_volumes
    monkeypatch.setattr(volumes, "scene_volumes", lambda *a: (calls.append(a), compute(*a))[1])
    scenes = ExactScenes(BALL, GridSpec(8))
    for one in (TSDF(), VoteField(), Occupancy()):
        one.of_scenes(scenes)
    assert len(calls) == 1
