"""Labels of a height map without learning: the table is flat, what rises from it is an object."""

from collections.abc import Sequence

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.types import Float32


class ByHeight:
    """Gives vertices above a level one class and all others that of the surface.

    A reference for map-based labelling, and a stand-in where no network is trained yet.

    Args:
        classes: names by class id; the first is the surface.
        raised: name of the class of everything higher.
        level: height (m) above which a vertex is of that class.
        confidence: probability of the class given; the others share the rest.
    """

    def __init__(
        self,
        classes: Sequence[str],
        raised: str,
        level: float = 0.004,
        confidence: float = 0.8,
    ) -> None:
        if raised not in classes or len(classes) < 2:
            raise ConfigError(
                f"raised = {raised} is none of the classes {', '.join(classes)}; give one of them"
            )
        if not 1 / len(classes) < confidence < 1:
            raise ConfigError(f"confidence = {confidence}; expected more than chance, below 1")
        self.classes = tuple(classes)
        self.raised = self.classes.index(raised)
        self.level = level
        self.confidence = confidence

    def label_map(self, height_map: HeightMap) -> Float32:
        """Probabilities (C, V, V), uniform where the map is unseen."""
        count = len(self.classes)
        labels = np.where(np.nan_to_num(height_map.heights) > self.level, self.raised, 0)
        label_mask = np.arange(count)[:, None, None] == labels
        probabilities = np.where(label_mask, self.confidence, (1 - self.confidence) / (count - 1))
        return np.where(height_map.seen, probabilities, 1 / count).astype(np.float32)
