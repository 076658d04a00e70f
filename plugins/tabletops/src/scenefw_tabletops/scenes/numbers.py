"""What generators of tables share: numbers of scenes by split, and checks of what they draw."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

from scenefw.core.errors import ConfigError, SettingError
from scenefw.core.final_split import FINAL
from scenefw.core.settings import COUNT, NOT_NEGATIVE, at_least
from scenefw.core.tabletop import SPLITS


class NumberedScenes:
    """Scenes 0, 1, ... for training, validation, test and the final split, in this order.

    Args:
        scenes: how many of each; three numbers if there is no final split.

    Raises:
        ConfigError: not three or four numbers from 0 on.
    """

    def __init__(self, scenes: Sequence[int]) -> None:
        if len(scenes) not in (len(SPLITS), len(SPLITS) + 1) or min(scenes) < 0:
            raise ConfigError(
                f"scenes = {list(scenes)}: expected a number for each of {', '.join(SPLITS)}, and "
                "one more where there is a final split"
            )
        self._ends = dict(zip((*SPLITS, FINAL), accumulate(scenes), strict=False))

    def numbers(self, split: str) -> Sequence[int]:
        """Indices of the scenes of a split.

        Raises:
            ConfigError: there is no such split.
        """
        names = list(self._ends)
        if split not in names:
            raise ConfigError(f"these tables have no split '{split}'; there are {', '.join(names)}")
        start = self._ends[names[names.index(split) - 1]] if split != names[0] else 0
        return range(start, self._ends[split])

    def split_of(self, index: int) -> str:
        """The split of a scene.

        Raises:
            ConfigError: there is no such scene.
        """
        for split, end in self._ends.items():
            if 0 <= index < end:
                return split
        last = max(self._ends.values()) - 1
        raise ConfigError(f"scene {index} is outside 0..{last}; change `scenes`")


def require_draws(
    minimum: int, maximum: int, scales: Sequence[float], trials: int
) -> tuple[float, float]:
    """The least and greatest size of models.

    Raises:
        ConfigError: numbers that draw nothing.
    """
    NOT_NEGATIVE.require(minimum=minimum)
    at_least(minimum).require(maximum=maximum)
    COUNT.require(trials=trials)
    if not 0 < scales[0] <= scales[1]:
        raise SettingError("scales", scales, "two factors above 0, the smaller first")
    return float(scales[0]), float(scales[1])
