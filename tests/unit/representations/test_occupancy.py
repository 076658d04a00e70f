"""Occupancy against the implicit function."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.types import GridSpec
from scenefw.representations.occupancy import Occupancy
from scenefw.representations.volumes import ExactScenes, object_occupancy

SCENE = SceneParameters(
    torch.tensor([[[0.1, 0.05, 0.12], [0.08, 0.15, 0.07], [0.1, 0.1, 0.1]]]),
    torch.tensor([[[2.0, 90, 7], [30, 2, 2.5], [3, 3, 3]]]),
    torch.eye(3).expand(1, 3, 3, 3),
    torch.tensor([[[0.0, 0.05, 0.1], [0.1, -0.1, 0.2], [0, 0, 0.3]]]),
    torch.tensor([[True, True, False]]),
)


@pytest.mark.parametrize("resolution", [32, 64])
def test_per_object(resolution):
    grid = GridSpec(resolution=resolution)
    occupancy = object_occupancy(SCENE, grid)
    assert occupancy.shape == (1, 3, *grid.shape)
    for i in range(2):
        u = np.abs(grid.centres() - SCENE.positions[0, i].numpy()) / SCENE.half_axes[0, i].numpy()
        with np.errstate(over="ignore"):
            value = (u ** SCENE.exponents[0, i].numpy()).sum(-1)
        clear = np.abs(value - 1) > 1e-4
        assert ((value < 1) == occupancy[0, i].numpy())[clear].all()
    assert not occupancy[0, 2].any()


def test_union():
    grid = GridSpec(resolution=20)
    union = Occupancy().of_scenes(ExactScenes(SCENE, grid))
    each = object_occupancy(SCENE, grid)
    assert union.shape == (1, 1, *grid.shape)
    assert torch.equal(union[:, 0], each[:, 0] | each[:, 1])


def test_nobody_there():
    empty = replace(SCENE, present=torch.zeros(1, 3, dtype=torch.bool))
    assert not Occupancy().of_scenes(ExactScenes(empty, GridSpec(resolution=8))).any()


def test_networks_give_logits_of_it():
    made, grid = Occupancy(), GridSpec(8)
    assert made.to_network(torch.tensor([True, False]), grid).tolist() == [1, 0]
    found = made.from_network(torch.tensor([0.0, 2.0]), grid)
    assert found.tolist() == pytest.approx([0.5, 1 / (1 + np.exp(-2))])
