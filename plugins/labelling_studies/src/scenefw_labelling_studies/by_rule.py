"""Labels of a height map by a rule: size, height and fill of connected components."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightMap
from scenefw.core.types import Float32
from scenefw_labelling_studies.components import FEATURES, Row, answers, components


class ByRule:
    """Gives each connected component above a level one class, by a tree of questions.

    A reference for map-based labelling that learns nothing from colour or detail.

    Args:
        classes: names by class id; the first is the surface.
        tree: rows of (feature, threshold, below, above). Features are those of
            `components.FEATURES`; what follows is a class, or the number of a later row.
        level: height (m) above which a vertex belongs to an object.
        confidence: probability of the class given; the others share the rest.

    Raises:
        ConfigError: a row asks for what there is not, or numbers are out of range.
    """

    def __init__(
        self,
        classes: Sequence[str],
        tree: Sequence[Sequence[str | float | int]],
        level: float = 0.002,
        confidence: float = 0.8,
    ) -> None:
        self.classes = tuple(classes)
        self.tree = [_row(number, row, self.classes, len(tree)) for number, row in enumerate(tree)]
        if not self.tree:
            raise ConfigError("tree is empty; give rows of feature, threshold, below, above")
        if not 1 / len(classes) < confidence < 1 or not level >= 0:
            raise ConfigError(
                f"confidence = {confidence}, level = {level} m; expected more than chance and "
                "below 1, and 0 or more"
            )
        self.level, self.confidence = level, confidence

    def label_map(self, height_map: HeightMap) -> Float32:
        """Probabilities (C, V, V), uniform where the map is unseen."""
        number, features = components(height_map.heights, self.level, height_map.grid.spacing)
        component_labels = [0, *(self.classes.index(name) for name in answers(features, self.tree))]
        labels = np.array(component_labels, dtype=np.int32)[number]
        count = len(self.classes)
        label_mask = np.arange(count)[:, None, None] == labels
        probabilities = np.where(label_mask, self.confidence, (1 - self.confidence) / (count - 1))
        return np.where(height_map.seen, probabilities, 1 / count).astype(np.float32)


def _row(number: int, row: Sequence[str | float | int], classes: Sequence[str], rows: int) -> Row:
    """A checked row of the tree."""
    if len(row) != 4 or row[0] not in FEATURES:
        raise ConfigError(
            f"row {number} of the tree is {list(row)}; expected one of {', '.join(FEATURES)}, a "
            "threshold, and what follows below it and from it on"
        )
    for follows in row[2:]:
        later = isinstance(follows, int) and number < follows < rows
        if not later and follows not in classes:
            raise ConfigError(
                f"row {number} of the tree leads to {follows}; expected a later row or one of "
                f"{', '.join(classes)}"
            )
    name, threshold, below, above = row
    return str(name), float(threshold), _follows(below), _follows(above)


def _follows(value: str | float | int) -> str | int:
    return value if isinstance(value, str) else int(value)
