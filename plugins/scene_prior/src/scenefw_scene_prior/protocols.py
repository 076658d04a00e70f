"""What a network of the scene prior promises."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from scenefw.core.training_protocols import SetFlowModel

if TYPE_CHECKING:
    import torch

    from scenefw.core.set_flows import SetFlowBatch


class WholeSetFlowModel(SetFlowModel, Protocol):
    """A flow that also draws objects of which nothing is seen (`draws_hidden`)."""

    def scenes(
        self,
        count: int,
        generator: torch.Generator,
        steps: int = 20,
        objects: int | None = None,
    ) -> SetFlowBatch:
        """Draws `count` scenes without a view, of as many objects; None: as many as it draws."""

    def hidden_number(self, batch: SetFlowBatch, generator: torch.Generator) -> int:
        """Draws how many objects a view hides whose seen objects are known."""

    def complete(
        self,
        batch: SetFlowBatch,
        count: int,
        objects: int,
        generator: torch.Generator,
        steps: int = 20,
    ) -> SetFlowBatch:
        """Draws `count` sets of so many hidden objects beside those of a view, which are known."""
