"""What methods for several views promise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Sequence

    import torch

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.types import GridSpec


class SeveralViewsReconstructor(Protocol):
    """A method that makes one complete scene of several views of it (group `several_views`)."""

    @property
    def grid(self) -> GridSpec | None:
        """The grid of its volumes; None if it takes any."""

    def complete_views(
        self,
        views: Sequence[PartialTSDF],
        grid: GridSpec,
        samples: int,
        generator: torch.Generator,
    ) -> Sequence[Completion]:
        """Complete scenes (batches of one), `samples` times, or once if all are the same.

        Raises:
            InputError: no view, or views that contradict each other.
        """
