"""Latent codes optimised until the scene explains all views (thesis 5.3.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from scenefw.core.settings import COUNT, NOT_NEGATIVE, POSITIVE
from scenefw.mapping.several_views import fused, require_agreement, stacked

if TYPE_CHECKING:
    from collections.abc import Sequence

    from torch import Tensor

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.types import GridSpec
    from scenefw.perception.completion.volume_network import VolumeNetwork
    from scenefw_several_views.differentiable import Differentiable


class OptimisedCode:
    """Optimises the code of a network against the depth images of all views by Adam.

    The network sees the first view alone, as in the thesis, or all views fused. The cost is the
    surface cost plus the empty-space cost (eq. 5.22) in units of the truncation, plus `prior` times
    half the mean square of the code, which keeps it where the decoder was trained. The code of the
    least cost is taken, which may be the one that it began with. A network without codes, or whose
    codes say nothing, gives the scene that it gives without this.

    Args:
        network: completes scenes from codes.
        renderer: of the cost, with gradients.
        iterations: steps of Adam; the thesis takes 30.
        rate: of Adam.
        prior: weight of the code's mean square.
        sees_all: the network sees all views; without it, the first one.

    Raises:
        ConfigError: no iteration, a rate that isn't positive, or a negative weight.
    """

    def __init__(
        self,
        network: VolumeNetwork,
        renderer: Differentiable,
        iterations: int = 30,
        rate: float = 0.1,
        prior: float = 1e-4,
        *,
        sees_all: bool = False,
    ) -> None:
        COUNT.require(iterations=iterations)
        POSITIVE.require(rate=rate)
        NOT_NEGATIVE.require(prior=prior)
        self.network, self.renderer, self.grid = network, renderer, network.grid
        self.iterations, self.rate, self.prior = iterations, rate, prior
        self.sees_all = sees_all

    def complete_views(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """Complete scenes: from the zero code first, then from drawn ones.

        Raises:
            InputError: no view, views that contradict each other, or that came without images.
        """
        require_agreement(views, grid)
        partial = fused(views, grid) if self.sees_all else views[0]
        codes = torch.zeros(samples, 1, self.network.model.latent_size)
        codes[1:] = torch.randn(codes[1:].shape, generator=generator)
        optimised_codes = [self.optimised(code, partial, views, grid)[0] for code in codes]
        return self.network.complete_with(partial, grid, torch.stack(optimised_codes))

    def optimised(
        self, code: Tensor, partial: PartialTSDF, views: Sequence[PartialTSDF], grid: GridSpec
    ) -> tuple[Tensor, list[float]]:
        """The best code (1, latent_size), and the cost at each iteration and at the end.

        Args:
            code: where to start.
            partial: what the network sees.
            views: with their images, that the scene is to explain.
            grid: the network's.
        """
        if not code.numel():
            return code, []
        inputs, stacked_views = self.network.inputs(partial, grid), stacked(views)
        parameter = code.detach().to(inputs.device).requires_grad_()
        best_code, costs = parameter.detach().clone(), []
        adam = torch.optim.Adam([parameter], lr=self.rate)
        for _ in range(self.iterations):
            with torch.enable_grad():
                cost = self._cost(parameter, inputs, stacked_views, grid)
                (parameter.grad,) = torch.autograd.grad(cost, parameter)
            costs.append(float(cost.detach()))
            if costs[-1] <= min(costs):
                best_code = parameter.detach().clone()
            adam.step()
        with torch.no_grad():
            costs.append(float(self._cost(parameter, inputs, stacked_views, grid)))
        return (parameter.detach() if costs[-1] <= min(costs) else best_code).cpu(), costs

    def _cost(self, code: Tensor, inputs: Tensor, views: PartialTSDF, grid: GridSpec) -> Tensor:
        assert views.depth is not None and views.cameras is not None  # noqa: PT018
        tsdf = self.network.model.predict(inputs, code).volumes["tsdf"][0, 0].float()
        surface_cost, empty_cost = self.renderer.costs(tsdf, grid, views.depth, views.cameras)
        total: Tensor = surface_cost + empty_cost + 0.5 * self.prior * code.square().mean()
        return total
