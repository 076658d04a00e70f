"""torch's Muon and AdamW as one optimiser: Lightning steps and stores only one."""

from collections.abc import Callable
from typing import Any

import torch
from torch import nn

from scenefw.core.errors import CheckpointError


class MuonAndAdamW(torch.optim.Optimizer):
    """`torch.optim.Muon` for matrices and convolutions, `torch.optim.AdamW` for the rest.

    torch's Muon takes matrices alone: it gets each weight as one with a row per output.

    Args:
        matrices: group of weights with two or more axes, with options of torch's Muon.
        rest: group of all others, with options of torch's AdamW.
    """

    def __init__(self, matrices: dict[str, Any], rest: dict[str, Any]) -> None:
        super().__init__([group for group in (matrices, rest) if group["params"]], {})
        self._parts = [self._part(group) for group in self.param_groups]

    @torch.no_grad()
    def step(self, closure: Callable[[], Any] | None = None) -> Any:
        """Changes all weights once; returns what the closure does."""
        with torch.enable_grad():
            loss = closure() if closure is not None else None
        for group, part in zip(self.param_groups, self._parts, strict=True):
            (own,) = part.param_groups
            own.update({name: value for name, value in group.items() if name != "params"})
            self._step(part, group["params"], own["params"])
        return loss

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """Resumes from a checkpoint.

        Raises:
            CheckpointError: it is of another implementation.
        """
        if any("use_muon" in group for group in state_dict["param_groups"]):
            raise CheckpointError(
                "this training began with the Muon of an earlier version, whose state differs; "
                "start over with run.fresh=true, or continue with the version that began it"
            )
        super().load_state_dict(state_dict)

    def _part(self, group: dict[str, Any]) -> torch.optim.Optimizer:
        if group["params"][0].ndim < 2:
            return torch.optim.AdamW([dict(group)])
        matrices = [nn.Parameter(weight.detach().flatten(1)) for weight in group["params"]]
        return torch.optim.Muon([{**group, "params": matrices}])

    def _step(
        self, part: torch.optim.Optimizer, weights: list[nn.Parameter], own: list[nn.Parameter]
    ) -> None:
        """The step of one part, on the shared state of each weight, which is stored as usual."""
        pairs = list(zip(weights, own, strict=True))
        for weight, mine in pairs:
            part.state[mine] = self.state[weight]
            if mine is not weight:  # a copy where the channels of a convolution come last in memory
                mine.data = weight.detach().flatten(1)
                mine.grad = None if weight.grad is None else weight.grad.flatten(1)
        part.step()
        for weight, mine in pairs:
            if mine is not weight:
                mine.grad = None  # else it would be held until the next step
            if mine.data_ptr() != weight.data_ptr():
                weight.copy_(mine.view_as(weight))
