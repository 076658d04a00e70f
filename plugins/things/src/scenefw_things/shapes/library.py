"""The library of things: families dealt out to the parts of the data, parameters too."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scenefw.core.errors import ConfigError
from scenefw_things.shapes.families import FAMILIES
from scenefw_things.shapes.family import Family
from scenefw_things.shapes.thing import Thing

PARTS = ("train", "val", "test", "final")

_CELLS = 10
_CELLS_OF = {"val": (2,), "test": (5,), "final": (8,), "train": (0, 1, 3, 4, 6, 7, 9)}
"""Tenths of the range of a family's first parameter that each part of the data has."""


class ThingLibrary:
    """Household things by formula; each part of the data has families and parameters of its own.

    A family that only one part lists is seen there alone. Where several parts list a family, its
    first parameter tells them apart: val has the third tenth of its range, test the sixth, final
    the ninth, train the others. So no two parts share a thing, or one nearly like it.

    Args:
        families: names of families by part, each as often as the others.
        compound_ratio: chance of a thing of the family `compound` in place of one of the list, for
            parts that list it.

    Raises:
        ConfigError: an unknown part or family, or a part without any.
    """

    def __init__(self, families: Mapping[str, Sequence[str]], compound_ratio: float = 0.15) -> None:
        for part, names in families.items():
            unknown = sorted(set(names) - set(FAMILIES))
            if part not in PARTS or unknown or not names:
                raise ConfigError(
                    f"shape.families.{part} = {list(names)}: expected a list for "
                    f"{', '.join(PARTS)}, of {', '.join(sorted(FAMILIES))}"
                )
        self.families = {part: tuple(names) for part, names in families.items()}
        self.compound_ratio = compound_ratio

    def thing(self, rng: np.random.Generator, split: str) -> Thing:
        """One random thing of a part of the data.

        Raises:
            ConfigError: the library has no such part.
        """
        names = self.names(split)
        if "compound" in names and rng.random() < self.compound_ratio:
            return self.thing_of("compound", rng, split)
        return self.thing_of(names[int(rng.integers(len(names)))], rng, split)

    def thing_of(self, name: str, rng: np.random.Generator, split: str) -> Thing:
        """One random thing of a family, with parameters of a part of the data."""
        family = FAMILIES[name]
        shared = sum(name in names for names in self.families.values()) > 1
        at = rng.random(len(family.limits))
        if shared:
            cells = _CELLS_OF[split]
            at[0] = (cells[int(rng.integers(len(cells)))] + at[0]) / _CELLS
        return Thing(name, _values(family, at), int(rng.integers(2**31)))

    def hollow(self, split: str) -> tuple[str, ...]:
        """Families of a part that hold others."""
        return tuple(name for name in self.names(split) if FAMILIES[name].hollow)

    def slender(self, split: str) -> tuple[str, ...]:
        """Families of a part that stand in a cup or lean."""
        return tuple(name for name in self.names(split) if FAMILIES[name].slender)

    def names(self, split: str) -> tuple[str, ...]:
        """Families of a part of the data.

        Raises:
            ConfigError: the library has no such part.
        """
        if split not in self.families:
            raise ConfigError(f"the library has no things for {split}; give shape.families.{split}")
        return self.families[split]


def _values(family: Family, at: np.ndarray) -> tuple[float, ...]:
    """Parameters at places 0..1 of their ranges, exact in float32."""
    low, high = np.array(list(family.limits.values())).T
    values = (low + at * (high - low)).astype(np.float32)
    return tuple(float(value) for value in values)
