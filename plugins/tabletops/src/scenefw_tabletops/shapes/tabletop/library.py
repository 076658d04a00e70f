"""The procedural models by class and instance."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.tabletop import COMPARISON, SMALL_OBJECTS, SPLITS, TexturedMesh
from scenefw_tabletops.shapes.tabletop import parts
from scenefw_tabletops.shapes.tabletop.book import book
from scenefw_tabletops.shapes.tabletop.brick import brick
from scenefw_tabletops.shapes.tabletop.coin import coin
from scenefw_tabletops.shapes.tabletop.keyboard import keyboard
from scenefw_tabletops.shapes.tabletop.model_plane import model_plane
from scenefw_tabletops.shapes.tabletop.parts import Part
from scenefw_tabletops.shapes.tabletop.pen import pen
from scenefw_tabletops.shapes.tabletop.remote_control import remote_control
from scenefw_tabletops.shapes.tabletop.wires import cable, paperclip

FAMILIES: Mapping[str, Callable[[np.random.Generator], list[Part]]] = {
    "remote_control": remote_control,
    "keyboard": keyboard,
    "model_plane": model_plane,
    "coin": coin,
    "cable": cable,
    "pen": pen,
    "brick": brick,
    "paperclip": paperclip,
    "book": book,
}
"""Makers of models by class: each draws size, proportion, detail and texture."""

SETS = {"comparison": COMPARISON, "small_objects": SMALL_OBJECTS}
_SHARES = (0.75, 0.10, 0.15)


class ProceduralModels:
    """Models made from numbers alone: no files, the same everywhere.

    Args:
        classes: `comparison` (surface and three), `small_objects` (surface and six), or names of
            `FAMILIES` after "surface".
        count: instances per class, the first 75 % for training, 10 % validation, 15 % test.
        seed: another seed, other models.

    Raises:
        ConfigError: a class without a maker, or too few instances to split.
    """

    def __init__(
        self, classes: str | Sequence[str] = "comparison", count: int = 66, seed: int = 0
    ) -> None:
        self.classes = _class_names(classes)
        self.parts = split_instances(count)
        self.seed = seed
        self._models: dict[tuple[int, int], TexturedMesh] = {}

    def instances(self, label: int, split: str) -> Sequence[int]:
        """Indices of the instances of a class in a split."""
        return self.parts[_known_split(split)]

    def model(self, label: int, instance: int) -> TexturedMesh:
        """One model; always the same for the same numbers."""
        if (label, instance) not in self._models:
            self._models[label, instance] = self._make(label, instance)
        return self._models[label, instance]

    def _make(self, label: int, instance: int) -> TexturedMesh:
        name = self.classes[label]
        rng = streams.generator(self.seed, zlib.crc32(name.encode()), instance)
        return parts.merge(FAMILIES[name](rng))


def split_instances(count: int) -> Mapping[str, Sequence[int]]:
    """Instances 0 .. count - 1 by split: 75 / 10 / 15 %, rounded, at least one each.

    Raises:
        ConfigError: fewer than three.
    """
    if count < len(SPLITS):
        raise ConfigError(f"{count} models of a class can't be split in three; give 3 or more")
    validation, test = (max(1, round(share * count)) for share in _SHARES[1:])
    ends = (count - validation - test, count - test, count)
    starts = (0, *ends)
    return {name: range(starts[i], ends[i]) for i, name in enumerate(SPLITS)}


def _known_split(split: str) -> str:
    if split not in SPLITS:
        raise ConfigError(f"split '{split}' is unknown; there are {', '.join(SPLITS)}")
    return split


def _class_names(classes: str | Sequence[str]) -> tuple[str, ...]:
    names = SETS.get(classes, (classes,)) if isinstance(classes, str) else tuple(classes)
    unknown_names = [name for name in names[1:] if name not in FAMILIES]
    if not names or names[0] != "surface" or len(names) < 2 or unknown_names:
        raise ConfigError(
            f"classes {classes!r} are unknown; give {' or '.join(SETS)}, or surface and some of "
            f"{', '.join(FAMILIES)}"
        )
    return tuple(names)
