"""Losses of any named volume, and what each loss asks of a training before the work."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import ShapeInstanceBatch, ShapeInstancePrediction, ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.losses.absolute_error import AbsoluteError
from scenefw.losses.binary_cross_entropy import BinaryCrossEntropy
from scenefw.losses.block_energy import BlockEnergy
from scenefw.losses.sample_spread import SampleSpread
from scenefw.losses.tsdf import TsdfLoss
from scenefw.losses.votes import VoteLoss

SETUP = ShapeInstanceSetup(GridSpec(16), {"tsdf": 1, "votes": 3, "mine": 2}, 4, redrawn=2)


def pair(seed=0):
    rng = np.random.default_rng(seed)
    output, target = rng.normal(size=(2, 2, 3, 3, 3)), rng.random((2, 2, 3, 3, 3))
    prediction = ShapeInstancePrediction({"mine": torch.from_numpy(output)})
    return prediction, ShapeInstanceBatch(torch.zeros(1), {"mine": torch.from_numpy(target)})


@pytest.mark.parametrize("seed", [0, 1])
def test_they_are_the_formulas(seed):
    prediction, batch = pair(seed)
    x, y = prediction.volumes["mine"].numpy(), batch.targets["mine"].numpy()
    found = float(AbsoluteError(target="mine")(prediction, batch))
    assert found == pytest.approx(np.abs(x - y).mean(), rel=1e-5)
    chance = 1 / (1 + np.exp(-x))
    entropy = -(y * np.log(chance) + (1 - y) * np.log(1 - chance)).mean()
    found = float(BinaryCrossEntropy(target="mine")(prediction, batch))
    assert found == pytest.approx(entropy, rel=1e-5)


@pytest.mark.parametrize(
    "loss", [TsdfLoss, VoteLoss, SampleSpread, BlockEnergy, AbsoluteError, BinaryCrossEntropy]
)
def test_a_volume_that_is_not_trained_on_is_found_before_the_work(loss):
    with pytest.raises(ConfigError, match="compares other, but the representations are tsdf"):
        loss(target="other").check(SETUP)
    loss(target="votes" if loss is VoteLoss else "tsdf").check(SETUP)


def test_votes_are_vectors():
    with pytest.raises(ConfigError, match="volumes of 3 channels, but mine has 2"):
        VoteLoss(target="mine").check(SETUP)


@pytest.mark.parametrize("loss", [SampleSpread(), BlockEnergy()])
def test_views_with_two_codes_are_missed_before_the_work(loss):
    alone = ShapeInstanceSetup(SETUP.grid, SETUP.targets, 4, redrawn=0)
    with pytest.raises(ConfigError, match="none of a batch of 4 has them"):
        loss.check(alone)
