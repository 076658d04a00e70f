"""A step whose last results are kept, for evaluations of methods that share it."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from scenefw.core.types import GridSpec, Int32
    from scenefw.perception.observation.observation import Observation
    from scenefw.perception.steps import Objects

Result = TypeVar("Result")


class Cached:
    """Keeps the last results of a segmentation or a grouping.

    Nothing differs from asking anew. Each thread has its own results; a copy in another process
    begins with nothing.

    Args:
        step: the segmentation or grouping.
        size: results that are kept: views of a scene are asked for again with one view more.
    """

    def __init__(self, step: Any, size: int = 8) -> None:
        self.step, self.size = step, size
        self._results = threading.local()

    def __reduce__(self) -> tuple[type[Cached], tuple[Any, int]]:
        return Cached, (self.step, self.size)

    @property
    def grid(self) -> GridSpec | None:
        """That of the grouping; None: any."""
        grid: GridSpec | None = self.step.grid
        return grid

    def segment(self, view: Observation) -> Int32:
        """Segments (H, W) of a view."""
        return self._get_or_compute((view.partial,), lambda: self.step.segment(view))

    def group(self, segments: Int32 | None, view: Observation) -> Objects:
        """Objects of a view."""
        return self._get_or_compute(
            (segments, view.partial), lambda: self.step.group(segments, view)
        )

    def _get_or_compute(
        self, arguments: tuple[object, ...], compute: Callable[[], Result]
    ) -> Result:
        entries: list[tuple[tuple[object, ...], Any]]
        entries = self._results.__dict__.setdefault("entries", [])
        for key, value in entries:
            if all(a is b for a, b in zip(key, arguments, strict=True)):
                cached_result: Result = value
                return cached_result
        result = compute()
        entries[:] = [*entries, (arguments, result)][-self.size :]
        return result
