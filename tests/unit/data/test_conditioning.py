import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF, SceneVolumes
from scenefw.core.types import GridSpec
from scenefw.data.conditioning import condition, training_batch


@pytest.mark.parametrize("resolution", [8, 16])
def test_condition_is_in_truncations_with_what_was_observed(resolution):
    grid = GridSpec(resolution)
    rng = np.random.default_rng(0)
    distance = rng.uniform(-1.2, 1.2, (2, 1, *grid.shape)).astype(np.float32) * grid.truncation
    observed = rng.random((2, 1, *grid.shape)) < 0.5
    partial = PartialTSDF(torch.from_numpy(distance), torch.from_numpy(observed))
    with_observed = condition(partial, grid, observed=True)
    expected = np.clip(distance / grid.truncation, -1, 1)
    np.testing.assert_allclose(with_observed[:, :1], expected, atol=1e-6)
    np.testing.assert_array_equal(with_observed[:, 1:], observed.astype(np.float32))
    np.testing.assert_array_equal(condition(partial, grid, observed=False), with_observed[:, :1])


def test_truth_is_the_objects_in_truncations():
    grid = GridSpec(8)
    tsdf = torch.full((1, 1, 8, 8, 8), grid.truncation / 2)
    volumes = SceneVolumes(tsdf, torch.ones(1, 3, 8, 8, 8), torch.zeros(1, 8, 8, 8))
    partial = PartialTSDF(tsdf, torch.ones_like(tsdf, dtype=torch.bool))
    batch = training_batch(partial, volumes, grid, observed=False)
    assert float(batch.tsdf.min()) == pytest.approx(0.5)
    assert float(batch.tsdf.max()) == pytest.approx(0.5)
    assert batch.votes is volumes.votes
