"""Weights of convolutions in memory, whatever networks have."""

import torch
from torch import nn

from scenefw.learning.module import _laid_out


def test_convolutions_of_both_kinds_lie_channels_last_and_say_the_same():
    network = nn.ModuleDict(
        {"image": nn.Conv2d(3, 4, 3), "volume": nn.Conv3d(2, 5, 3), "rest": nn.Linear(6, 7)}
    )
    before = {name: weights.clone() for name, weights in network.state_dict().items()}
    laid = _laid_out(network)
    assert laid["image"].weight.is_contiguous(memory_format=torch.channels_last)
    assert laid["volume"].weight.is_contiguous(memory_format=torch.channels_last_3d)
    assert laid["rest"].weight.is_contiguous()
    for name, weights in laid.state_dict().items():
        assert torch.equal(weights, before[name])
