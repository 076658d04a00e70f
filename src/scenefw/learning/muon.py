"""Muon and AdamW as one optimiser: Lightning steps and stores only one."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from scenefw.core.errors import CheckpointError

_ITERATIONS = 5
_COEFFICIENTS = 3.4445, -4.7750, 2.0315  # of the quintic, from Jordan et al. 2024


class MuonAndAdamW(torch.optim.Optimizer):
    """Muon for matrices and convolutions, `torch.optim.AdamW` for the rest.

    `torch.optim.Muon` iterates in bfloat16, which takes 20 times as long as float32 on a CPU
    without bfloat16 instructions, and it takes no convolutions. Here all is float32; the steps are
    otherwise the same.

    Args:
        matrices: group of weights with two or more axes: lr, momentum, weight_decay.
        vectors: group of all others, with options of torch's AdamW.
    """

    def __init__(self, matrices: dict[str, Any], vectors: dict[str, Any]) -> None:
        super().__init__([group for group in (matrices, vectors) if group["params"]], {})
        self._adamw = [
            torch.optim.AdamW([dict(group)])
            for group in self.param_groups
            if group["params"][0].ndim < 2
        ]

    @torch.no_grad()
    def step(self, closure: Callable[[], Any] | None = None) -> Any:
        """Changes all weights once; returns what the closure does."""
        with torch.enable_grad():
            loss = closure() if closure is not None else None
        for group in self.param_groups:
            if group["params"][0].ndim < 2:
                self._step_by_adamw(group)
            else:
                self._step_by_muon(group)
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

    def _step_by_adamw(self, group: dict[str, Any]) -> None:
        """Torch's step, on the state that is stored here."""
        (adamw,) = self._adamw
        (adamw_group,) = adamw.param_groups
        adamw_group.update({name: value for name, value in group.items() if name != "params"})
        for weight in group["params"]:
            adamw.state[weight] = self.state[weight]
        adamw.step()

    def _step_by_muon(self, group: dict[str, Any]) -> None:
        """Nesterov momentum, made orthogonal."""
        rate, momentum = group["lr"], group["momentum"]
        for weight in group["params"]:
            if weight.grad is None:
                continue
            state = self.state[weight]
            if "momentum_buffer" not in state:
                state["momentum_buffer"] = torch.zeros_like(weight.grad)
            mean = state["momentum_buffer"].lerp_(weight.grad, 1 - momentum)
            ahead = weight.grad.lerp(mean, momentum).flatten(1)
            rows, columns = ahead.shape
            weight.mul_(1 - rate * group["weight_decay"])
            scale = rate * max(1.0, rows / columns) ** 0.5
            weight.sub_(orthogonal(ahead).view(weight.shape), alpha=scale)


def orthogonal(matrix: Tensor) -> Tensor:
    """About U V^T of a matrix with the singular value decomposition U S V^T.

    Five Newton-Schulz iterations leave singular values between 0.7 and 1.2, and smaller ones of
    directions that hardly move.

    Args:
        matrix: (R, C).

    Returns:
        (R, C) float32.
    """
    wide = matrix.float().T if matrix.shape[0] > matrix.shape[1] else matrix.float()
    wide = wide / wide.norm().clamp(min=1e-7)
    first, second, third = _COEFFICIENTS
    for _ in range(_ITERATIONS):
        gram = wide @ wide.T
        gram = torch.addmm(gram, gram, gram, beta=second, alpha=third)
        wide = torch.addmm(wide, gram, wide, beta=first)
    return (wide.T if matrix.shape[0] > matrix.shape[1] else wide).contiguous()
