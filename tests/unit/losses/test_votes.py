from dataclasses import replace

import numpy as np
import pytest
import torch
from tests.unit.losses.volumes import random_pair

from scenefw.losses.votes import VoteLoss


@pytest.mark.parametrize("resolution", [3, 6])
def test_it_is_the_mean_norm_of_the_difference(resolution):
    prediction, batch = random_pair(resolution)
    difference = prediction.votes.detach().numpy() - batch.votes.numpy()
    expected = np.linalg.norm(difference, axis=1).mean()
    assert float(VoteLoss(epsilon=1e-6)(prediction, batch)) == pytest.approx(expected, rel=1e-5)


def test_perfect_votes_cost_nothing_and_have_a_finite_gradient():
    prediction, batch = random_pair()
    votes = batch.votes.clone().requires_grad_()
    loss = VoteLoss()(replace(prediction, volumes={"votes": votes}), batch)
    loss.backward()
    assert float(loss) == pytest.approx(0, abs=1e-7)
    assert torch.isfinite(votes.grad).all()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.8])
def test_voxels_of_objects_have_their_share_of_the_loss(share):
    prediction, batch = random_pair(resolution=5)
    error = np.linalg.norm(prediction.votes.detach().numpy() - batch.votes.numpy(), axis=1)
    inside = batch.tsdf.numpy()[:, 0] < 0
    expected = share * error[inside].mean() + (1 - share) * error[~inside].mean()
    loss = VoteLoss(epsilon=1e-6, object_share=share)(prediction, batch)
    assert float(loss) == pytest.approx(expected, rel=1e-5)


def test_a_grid_without_objects_has_no_object_term():
    prediction, batch = random_pair(3)
    empty = replace(batch, targets={"votes": torch.zeros_like(batch.votes)})
    loss = VoteLoss(epsilon=1e-6, object_share=0.8)(prediction, empty)
    expected = 0.2 * np.linalg.norm(prediction.votes.detach().numpy(), axis=1).mean()
    assert float(loss) == pytest.approx(expected, rel=1e-5)
