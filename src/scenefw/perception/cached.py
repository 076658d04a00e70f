"""Another reconstructor's scenes, made once for all who ask for those of the same view."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, NamedTuple

import torch

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import Completion, PartialTSDF
    from scenefw.core.types import GridSpec
    from scenefw.perception.grouping.relabelling import Completing
    from scenefw.postprocessing.confidence import Calibration


class _Last(NamedTuple):
    """What was asked for, the scenes, and the generator's state after they were made."""

    partial: PartialTSDF
    grid: GridSpec
    samples: int
    before: Tensor
    after: Tensor
    scenes: list[Completion]

    def answers(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> bool:
        """Whether the same is asked for, of the same view and with the same random numbers."""
        same = partial is self.partial and (grid, samples) == (self.grid, self.samples)
        return same and torch.equal(generator.get_state(), self.before)


class Remembered:
    """Remembers the last view's scenes, which several methods of an evaluation begin with.

    Each thread remembers its own; a copy in another process begins with nothing. Nothing differs
    from asking anew: neither the scenes nor the state in which the generator is left.

    Args:
        inner: makes the scenes.
    """

    calibration: Calibration | None = None

    def __init__(self, inner: Completing) -> None:
        self.inner = inner
        self.grid, self.metadata = inner.grid, inner.metadata
        self._of_thread = threading.local()

    def __reduce__(self) -> tuple[type[Remembered], tuple[Completing]]:
        return Remembered, (self.inner,)

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> list[Completion]:
        """The inner method's complete scenes."""
        last: _Last | None = self._of_thread.__dict__.get("last")
        if last is None or not last.answers(partial, grid, samples, generator):
            before = generator.get_state()
            scenes = list(self.inner.complete(partial, grid, samples, generator))
            last = _Last(partial, grid, samples, before, generator.get_state(), scenes)
            self._of_thread.last = last
        generator.set_state(last.after)
        return list(last.scenes)
