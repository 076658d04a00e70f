import numpy as np
import pytest
import torch
from tests.unit.losses.volumes import random_pair

from scenefw.losses.tsdf import TsdfLoss, weighted_distance_error


@pytest.mark.parametrize("resolution", [3, 6])
def test_it_is_equation_5_13_with_a_floored_weight(resolution):
    prediction, batch = random_pair(resolution)
    v, guess = batch.tsdf.numpy(), prediction.tsdf.detach().numpy()
    expected = np.mean(np.abs(v - guess) / np.maximum(np.abs(v), 0.2))
    loss = TsdfLoss(floor=0.2, one_sided=False)(prediction, batch)
    assert float(loss) == pytest.approx(expected, rel=1e-5)


def test_beyond_the_truncation_all_distances_are_right_where_the_truth_is_cut():
    truth = torch.tensor([1.0, 1.0, -1.0, -1.0, 0.5])
    guess = torch.tensor([3.0, 0.5, -4.0, -0.5, 2.5])
    found = weighted_distance_error(guess, truth, 0.1, one_sided=True)
    assert float(found) == pytest.approx((0 + 0.5 + 0 + 0.5 + 2.0 / 0.5) / 5)


def test_one_side_only_differs_where_it_says():
    prediction, batch = random_pair(5)
    cut = np.abs(batch.tsdf.numpy()) >= 1
    guess, v = prediction.tsdf.detach().numpy(), batch.tsdf.numpy()
    guess = np.where(cut & (np.sign(v) * guess > 1), v, guess)
    expected = np.mean(np.abs(v - guess) / np.maximum(np.abs(v), 0.1))
    assert float(TsdfLoss()(prediction, batch)) == pytest.approx(expected, rel=1e-5)


def test_surface_voxels_weigh_at_most_one_over_the_floor():
    truth = torch.tensor([0.0, 1.0])
    near = weighted_distance_error(torch.tensor([0.01, 1.0]), truth, 0.1, one_sided=True)
    far = weighted_distance_error(torch.tensor([0.0, 0.99]), truth, 0.1, one_sided=True)
    assert float(near / far) == pytest.approx(10, rel=1e-3)


def test_gradient_is_that_of_finite_differences():
    truth = torch.tensor([1.0, -1.0, 0.3, 0.0], dtype=torch.float64)
    guess = torch.tensor([0.4, -2.0, 0.9, 0.2], dtype=torch.float64, requires_grad=True)
    weighted_distance_error(guess, truth, 0.1, one_sided=True).backward()
    expected = np.array([-1.0, 0.0, 1 / 0.3, 10.0]) / 4
    np.testing.assert_allclose(guess.grad, expected, rtol=1e-6)
