"""The loop of evaluations that score scene by scene: side by side, and resumed where it ended."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, TypeVar

import torch

from scenefw.evaluation.kept_rows import kept_or_made
from scenefw.evaluation.side_by_side import side_by_side

if TYPE_CHECKING:
    from collections.abc import Callable

    from scenefw.core.protocols import Track
    from scenefw.evaluation.kept_rows import KeptRows

Score = TypeVar("Score")


def scored_scenes(
    score: Callable[[int], Score],
    count: int,
    restored: Callable[[Any], Score],
    track: Track,
    row_store: KeptRows | None = None,
    workers: int | None = None,
    packed: Callable[[Any], object] = asdict,
) -> list[Score]:
    """Scores of scenes 0 .. count - 1, in this order.

    Args:
        score: of one scene, in any thread.
        count: of the scenes.
        restored: a score of what `packed` gave, after it was written and read as JSON.
        track: shows a bar of the loop.
        row_store: where scores are kept as soon as they are there; those of an earlier run that
            was cut off are taken from it. None keeps none.
        workers: scenes at once, as of `side_by_side`.
        packed: a score as JSON types; by default the fields of a dataclass.
    """
    return kept_or_made(
        row_store,
        {str(row): row for row in range(count)},
        lambda pending, on_result: side_by_side(
            score, pending, track, "scenes", workers, on_result
        ),
        packed,
        restored,
    )


def workers_on(device: str, workers: int | None) -> int | None:
    """The given number of workers; without one, a single worker where a GPU computes.

    On the CPU None stays None: `side_by_side` takes as many as torch has threads.
    """
    return 1 if workers is None and torch.device(device).type != "cpu" else workers
