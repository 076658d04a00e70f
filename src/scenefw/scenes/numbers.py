"""What generators of tables share: numbers of scenes by split, and checks of what they draw."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from scenefw.core.errors import ConfigError
from scenefw.core.tabletop import SPLITS


class NumberedScenes:
    """Scenes 0, 1, ... for training, validation and test, numbered in this order.

    Args:
        scenes: how many of each.

    Raises:
        ConfigError: not three numbers from 0 on.
    """

    def __init__(self, scenes: Sequence[int]) -> None:
        if len(scenes) != len(SPLITS) or min(scenes) < 0:
            raise ConfigError(f"scenes = {list(scenes)}: expected three numbers, one per split")
        self._ends = tuple(accumulate(scenes))

    def numbers(self, split: str) -> Sequence[int]:
        """Indices of the scenes of a split.

        Raises:
            ConfigError: there is no such split.
        """
        if split not in SPLITS:
            raise ConfigError(f"split '{split}' is unknown; there are {', '.join(SPLITS)}")
        part = SPLITS.index(split)
        return range((0, *self._ends)[part], self._ends[part])

    def split_of(self, index: int) -> str:
        """The split of a scene.

        Raises:
            ConfigError: there is no such scene.
        """
        for split, end in zip(SPLITS, self._ends, strict=True):
            if 0 <= index < end:
                return split
        raise ConfigError(f"scene {index} is outside 0..{self._ends[-1] - 1}; change `scenes`")


def require_draws(
    minimum: int, maximum: int, scales: Sequence[float], trials: int
) -> tuple[float, float]:
    """The least and greatest size of models.

    Raises:
        ConfigError: numbers that draw nothing.
    """
    if not 0 <= minimum <= maximum or not 0 < scales[0] <= scales[1] or trials < 1:
        raise ConfigError(
            f"minimum = {minimum}, maximum = {maximum}, scales = {list(scales)}, trials = "
            f"{trials}: expected 0 <= minimum <= maximum, scales in order and trials >= 1"
        )
    return float(scales[0]), float(scales[1])
