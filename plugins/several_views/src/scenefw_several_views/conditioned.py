"""Several views as one partial TSDF, completed by any method (thesis 5.3.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.mapping.several_views import fused

if TYPE_CHECKING:
    from collections.abc import Sequence

    import torch

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.protocols import Reconstructor
    from scenefw.core.types import GridSpec


class Conditioned:
    """Completes the fused partial TSDF of all views, in one pass.

    With a trained network this is the thesis's multi-view conditioning; with the partial TSDF
    itself as the scene, plain TSDF fusion.

    Args:
        method: completes a partial TSDF that has no image.
    """

    def __init__(self, method: Reconstructor) -> None:
        self.method, self.grid = method, method.grid

    def complete_views(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> list[Completion]:
        """Complete scenes of the method.

        Raises:
            InputError: no view, or views that contradict each other.
        """
        return list(self.method.complete(fused(views, grid), grid, samples, generator))
