"""Optimisers, made for the weights of a network."""

from dataclasses import dataclass
from typing import Protocol

import torch
from torch import nn

from scenefw.core.settings import POSITIVE, below
from scenefw.learning.muon import MuonAndAdamW

RATE = "rate"
"""Key of a group of weights: what its learning rate is times that of the training."""


class Optimizer(Protocol):
    """How gradients change weights (group `optimizer`)."""

    def make(
        self, model: nn.Module, learning_rate: float, weight_decay: float, *, fused: bool
    ) -> torch.optim.Optimizer:
        """An optimiser of the weights that need a gradient.

        Args:
            model: the network.
            learning_rate: at factor 1; the training sets it at each step, times `RATE`.
            weight_decay: decoupled from the gradient, times the learning rate of its group.
            fused: whether a step may run as one kernel.
        """


@dataclass(frozen=True)
class AdamW:
    """Adam with decoupled weight decay (Loshchilov and Hutter 2019); Adam where that is 0."""

    def make(
        self, model: nn.Module, learning_rate: float, weight_decay: float, *, fused: bool
    ) -> torch.optim.Optimizer:
        """An optimiser of the weights that need a gradient."""
        weights = [p for p in model.parameters() if p.requires_grad]
        return torch.optim.AdamW(weights, lr=learning_rate, weight_decay=weight_decay, fused=fused)


@dataclass(frozen=True)
class Muon:
    """Orthogonal updates of matrices and convolutions, AdamW for biases, norms and slopes.

    The momentum M of a weight, as a matrix with a row per output, is replaced by about U V^T of its
    singular value decomposition U S V^T (five Newton-Schulz iterations), so that all its
    directions move alike: W -= rate * learning_rate * sqrt(max(1, rows / columns)) * U V^T.

    Reference: Jordan et al. 2024, Muon: an optimizer for hidden layers in neural networks.

    Args:
        rate: what the learning rate of matrices is times that of the rest.
        momentum: decay of the average of gradients.

    Raises:
        ConfigError: the rate is not positive or the momentum is outside [0, 1).
    """

    rate: float = 20.0
    momentum: float = 0.95

    def __post_init__(self) -> None:
        POSITIVE.require(rate=self.rate)
        below(1).require(momentum=self.momentum)

    def make(
        self, model: nn.Module, learning_rate: float, weight_decay: float, *, fused: bool
    ) -> torch.optim.Optimizer:
        """An optimiser of the weights that need a gradient."""
        weights = [p for p in model.parameters() if p.requires_grad]
        matrices = {
            "params": [p for p in weights if p.ndim >= 2],
            "lr": self.rate * learning_rate,
            "weight_decay": weight_decay,
            "momentum": self.momentum,
            RATE: self.rate,
        }
        vectors = {
            "params": [p for p in weights if p.ndim < 2],
            "lr": learning_rate,
            "weight_decay": weight_decay,
            "fused": fused,
            RATE: 1.0,
        }
        return MuonAndAdamW(matrices, vectors)
