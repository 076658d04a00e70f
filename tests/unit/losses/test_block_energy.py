import itertools

import numpy as np
import pytest
import torch
from tests.unit.losses.test_sample_spread import redrawn_pair
from tests.unit.losses.volumes import random_pair

from scenefw.core.batches import RedrawnShapes, ShapeInstanceBatch, ShapeInstancePrediction
from scenefw.core.errors import ConfigError
from scenefw.losses.block_energy import BlockEnergy


@pytest.mark.parametrize(("resolution", "block"), [(4, 2), (6, 3), (6, 6), (4, 1)])
def test_it_is_the_energy_score_of_each_block(resolution, block):
    prediction, batch = redrawn_pair(resolution)
    rows = slice(1, 3)
    first = prediction.tsdf.detach().numpy()[rows].clip(-1, 1)
    second = prediction.redrawn.tsdf.detach().numpy().clip(-1, 1)
    truth = batch.tsdf.numpy()[rows]
    scores = []
    for view, *corner in itertools.product(range(2), *[range(0, resolution, block)] * 3):
        at = (view, 0, *(slice(c, c + block) for c in corner))
        a, b, t = (volume[at].ravel() for volume in (first, second, truth))
        apart = [np.linalg.norm(x - y) / np.sqrt(block**3) for x, y in ((a, t), (b, t), (a, b))]
        scores.append(0.5 * (apart[0] + apart[1] - apart[2]))
    found = BlockEnergy(block=block)(prediction, batch)
    assert float(found.detach()) == pytest.approx(np.mean(scores), abs=2e-3)
    found.backward()
    assert prediction.redrawn.tsdf.grad.any()
    assert not prediction.tsdf.grad[0].any()


def energy(samples, truths, block):
    """Mean score of equally likely samples for equally likely truths; volumes of 2^3 voxels."""
    total = 0.0
    for truth, first, second in itertools.product(truths, samples, samples):
        first, second, truth = (v.view(1, 1, 2, 2, 2) for v in (first, second, truth))
        batch = ShapeInstanceBatch(truth, {"tsdf": truth})
        shapes = RedrawnShapes(slice(0, 1), {"tsdf": second})
        prediction = ShapeInstancePrediction({"tsdf": first}, redrawn=shapes)
        total += float(BlockEnergy(block=block)(prediction, batch))
    return total / len(truths) / len(samples) ** 2


def test_the_true_distribution_is_best_and_independent_voxels_are_told_from_it():
    """The truth is all solid or all empty; single voxels can't tell that from coin flips."""
    whole = [torch.full((8,), value) for value in (-0.5, 0.5)]
    flips = [0.5 * torch.tensor(signs) for signs in itertools.product((-1.0, 1.0), repeat=8)][::5]
    middle = [torch.zeros(8)]
    assert energy(whole, whole, 2) < energy(flips, whole, 2) - 0.05
    assert energy(whole, whole, 2) < energy(middle, whole, 2) - 0.05
    assert energy(whole, whole, 1) == pytest.approx(energy(flips, whole, 1), abs=0.02)


def test_samples_that_agree_on_the_truth_score_nothing():
    truth = [torch.linspace(-0.8, 0.8, 8)]
    assert energy(truth, truth, 2) == pytest.approx(0.005, abs=1e-6)  # half the root of _LEAST


def test_wrong_settings_are_errors():
    with pytest.raises(ConfigError, match="prior_share"):
        BlockEnergy()(*random_pair())
    with pytest.raises(ConfigError, match="divides"):
        BlockEnergy(block=3)(*redrawn_pair(4))
    with pytest.raises(ConfigError, match="block = "):
        BlockEnergy(block=0)
