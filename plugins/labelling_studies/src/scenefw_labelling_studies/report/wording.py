"""What sections of labelling say alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenefw.evaluation.statistics import Interval

DEFINITION = (
    "Mean IoU: of each scene the mean over the classes that its truth holds, each counting the "
    "same, over all vertices of the orthographic ground truth; a vertex that is unseen or has no "
    "label yet counts as missed. `over seen` leaves unseen vertices out. Then mean over scenes, "
    "with Student's t bounds of 95 %."
)


def bounds_text(interval: Interval, digits: int = 3) -> str:
    """Both ends in parentheses, or a dash where there are none."""
    if np.isnan(interval.low):
        return "–"
    return f"({interval.low:.{digits}f}, {interval.high:.{digits}f})"


def listed(numbers: Sequence[int]) -> str:
    """Numbers in words: 1, 2 and 3."""
    words = [str(number) for number in numbers]
    return " and ".join(filter(None, [", ".join(words[:-1]), words[-1]]))
