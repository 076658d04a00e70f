"""Models of cluttered desks by class and instance."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.final_split import FINAL
from scenefw.core.tabletop import DESK, TexturedMesh
from scenefw_tabletops.shapes.desk import known, limp, other_flat, other_long, other_round
from scenefw_tabletops.shapes.tabletop import parts
from scenefw_tabletops.shapes.tabletop.library import split_instances
from scenefw_tabletops.shapes.tabletop.parts import Part

Maker = Callable[[np.random.Generator], list[Part]]

KNOWN: Mapping[str, Maker] = {
    "remote_control": known.remote_control,
    "keyboard": known.keyboard,
    "model_plane": known.model_plane,
    "coin": known.coin,
    "pen": known.pen,
    "brick": known.brick,
    "paperclip": known.paperclip,
    "book": known.book,
}
"""Makers of stiff models by class."""

OTHERS: Sequence[Maker] = (
    other_flat.phone, other_flat.calculator, other_flat.box, other_flat.organiser,
    other_flat.sheet, other_flat.card, other_flat.sponge, other_flat.pencil_case,
    other_flat.laptop, other_flat.pad, other_round.washer, other_round.disc, other_round.cup,
    other_round.plate, other_round.roll, other_round.cell, other_round.band, other_round.mouse,
    other_round.controller, other_long.ruler, other_long.stick, other_long.tool, other_long.cross,
    other_long.clip_or_key, other_long.scissors, other_long.die_or_block,
)  # fmt: skip
"""Makers of things that belong to no class but `other`."""


class DeskModels:
    """Models made from numbers alone: nine classes and `other`, alike in size and colour.

    Instance i of `other` is of kind i modulo the number of kinds, so that every split has every
    kind where it has instances enough.

    Args:
        count: instances per class, the first 75 % for training, 10 % validation, 15 % test; the
            final split has as many as the test, which follow them.
        others: instances of `other`, split alike.
        seed: another seed, other models.

    Raises:
        ConfigError: too few instances to split.
    """

    def __init__(self, count: int = 66, others: int = 280, seed: int = 0) -> None:
        self.classes = DESK
        self.seed = seed
        class_splits, other_splits = _with_final(count), _with_final(others)
        self.parts = [other_splits if name == "other" else class_splits for name in DESK]
        self._models: dict[tuple[int, int], TexturedMesh] = {}

    def instances(self, label: int, split: str) -> Sequence[int]:
        """Indices of the instances of a class in a split."""
        parts = self.parts[label]
        if split not in parts:
            raise ConfigError(f"split '{split}' is unknown; there are {', '.join(parts)}")
        return parts[split]

    def model(self, label: int, instance: int) -> TexturedMesh:
        """One model; always the same for the same numbers."""
        if (label, instance) not in self._models:
            self._models[label, instance] = self._make(DESK[label], instance)
        return self._models[label, instance]

    def _make(self, name: str, instance: int) -> TexturedMesh:
        rng = streams.generator(self.seed, zlib.crc32(f"desk {name}".encode()), instance)
        if name == "cable":
            return limp.cable(rng)
        maker = OTHERS[instance % len(OTHERS)] if name == "other" else KNOWN[name]
        return parts.merge(maker(rng))


def _with_final(count: int) -> Mapping[str, Sequence[int]]:
    parts = split_instances(count)
    return {**parts, FINAL: range(count, count + len(parts["test"]))}
