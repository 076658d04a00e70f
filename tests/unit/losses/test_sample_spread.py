from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.losses.volumes import random_pair

from scenefw.core.batches import RedrawnShapes, ShapeInstanceBatch, ShapeInstancePrediction
from scenefw.core.errors import ConfigError
from scenefw.losses.sample_spread import SampleSpread
from scenefw.losses.tsdf import TsdfLoss


def redrawn_pair(resolution=4, rows=slice(1, 3)):
    prediction, batch = random_pair(resolution)
    second = torch.from_numpy(
        np.random.default_rng(9).uniform(-1.5, 1.5, (2, 1, *(resolution,) * 3))
    )
    shapes = RedrawnShapes(rows, {"tsdf": second.requires_grad_()})
    return replace(prediction, redrawn=shapes), batch


@pytest.mark.parametrize("resolution", [4, 6])
def test_it_is_half_the_weighted_distance_of_two_samples(resolution):
    prediction, batch = redrawn_pair(resolution)
    first = prediction.tsdf.detach().numpy()[1:3].clip(-1, 1)
    second = prediction.redrawn.tsdf.detach().numpy().clip(-1, 1)
    truth = batch.tsdf.numpy()
    apart = np.abs(first - second) / np.maximum(np.abs(truth[1:3]), 0.2)
    expected = -0.5 * apart.sum() / truth.size
    found = SampleSpread(floor=0.2)(prediction, batch)
    assert float(found.detach()) == pytest.approx(expected, rel=1e-5)
    found.backward()
    assert prediction.redrawn.tsdf.grad.any()
    assert not prediction.tsdf.grad[0].any()
    assert prediction.tsdf.grad[1:].any()


def energy(spread, truths, *, middle=0.0):
    """Mean score of samples middle +- spread, drawn evenly, for equally likely truths."""
    ends = torch.tensor([middle - spread, middle + spread], dtype=torch.float64)
    first, second = (grid.flatten() for grid in torch.meshgrid(ends, ends, indexing="ij"))
    total = 0.0
    for truth in truths:
        tsdf = torch.full((4, 1, 1, 1, 1), truth, dtype=torch.float64)
        shapes = [values.view(4, 1, 1, 1, 1) for values in (first, second)]
        batch = ShapeInstanceBatch(tsdf, {"tsdf": tsdf})
        prediction = ShapeInstancePrediction(
            {"tsdf": shapes[0]}, redrawn=RedrawnShapes(slice(0, 4), {"tsdf": shapes[1]})
        )
        total += float(TsdfLoss()(prediction, batch) + SampleSpread()(prediction, batch))
    return total / len(truths)


def test_with_the_tsdf_loss_the_true_distribution_is_best():
    truths = (-0.4, 0.4)
    scores = {spread: energy(spread, truths) for spread in (0.0, 0.2, 0.4, 0.6, 0.9)}
    assert min(scores, key=scores.get) == 0.4
    assert energy(0.4, truths) < energy(0.4, truths, middle=0.1)


def test_where_the_truth_is_known_samples_should_agree():
    assert energy(0.0, (0.3,), middle=0.3) < energy(0.05, (0.3,), middle=0.3)


def test_a_view_with_one_code_is_an_error():
    with pytest.raises(ConfigError, match="prior_share"):
        SampleSpread()(*random_pair())


def test_a_floor_of_zero_is_an_error():
    with pytest.raises(ConfigError, match="floor"):
        SampleSpread(floor=0.0)
