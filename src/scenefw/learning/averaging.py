"""Exponential moving average of a network's weights."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch
from torch import Tensor, nn


class AveragedWeights:
    """Keeps a moving average of weights and batch statistics, which predicts better early on.

    Args:
        model: the network that is trained.
        decay: how much of the average stays at each step; less in the first steps.
    """

    def __init__(self, model: nn.Module, decay: float) -> None:
        self.decay, self.updates = decay, 0
        self.values = {name: value.detach().clone() for name, value in _floats(model).items()}

    @torch.no_grad()
    def update(self, model: nn.Module) -> None:
        """Adds the weights of one more step."""
        self.updates += 1
        decay = min(self.decay, (1 + self.updates) / (10 + self.updates))
        current = _floats(model)
        mine = [self.values[name] for name in current]
        torch._foreach_lerp_(mine, [v.detach() for v in current.values()], 1 - decay)

    @contextmanager
    def swapped(self, model: nn.Module) -> Iterator[None]:
        """Puts the average into the network, and restores the network's own weights at the end."""
        trained_weights = {name: value.detach().clone() for name, value in _floats(model).items()}
        _write(model, self.values)
        try:
            yield
        finally:
            _write(model, trained_weights)

    def state_dict(self) -> dict[str, object]:
        """The state for a checkpoint."""
        return {"updates": self.updates, "values": self.values}

    def load_state_dict(self, state: dict[str, object]) -> None:
        """Resumes from a checkpoint."""
        self.updates = int(state["updates"])  # type: ignore[call-overload]
        for name, value in state["values"].items():  # type: ignore[attr-defined]
            self.values[name].copy_(value)

    def to(self, device: torch.device) -> None:
        """Moves the average to the network's device."""
        self.values = {name: value.to(device) for name, value in self.values.items()}


def _floats(model: nn.Module) -> dict[str, Tensor]:
    return {n: v for n, v in model.state_dict().items() if v.is_floating_point()}


@torch.no_grad()
def _write(model: nn.Module, values: dict[str, Tensor]) -> None:
    for name, value in _floats(model).items():
        value.copy_(values[name])
