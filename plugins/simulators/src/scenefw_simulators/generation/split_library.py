"""The repertoire of superquadrics of data sets v2: several families, and shapes split by part."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TypedDict

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.settings import NOT_NEGATIVE, SHARE
from scenefw.shapes.superquadric import Array, Superquadric
from scenefw_simulators.generation.library import draw_exponents, single

_NUMBERS = {"train": 0, "val": 1, "test": 2, "final": 3}  # of the random stream of each part


class Family(TypedDict):
    """Shapes of one kind.

    Args:
        share: of the shapes, relative to those of the other families.
        extents: smallest and largest full extent of each of the three axes (m).
    """

    share: float
    extents: Sequence[Sequence[float]]


class SplitLibrary:
    """A repertoire of superquadrics whose parts (train, val, test, final) share no shape.

    Each part has its own random stream, so its shapes don't depend on the sizes of the others.
    Extents are uniform, exponents log-uniform; all are exact in float32, as stored.

    Args:
        families: by name.
        sizes: number of shapes of each part.
        exponents: smallest and largest exponent of eq. 5.1.
        paired: share of shapes with two equal exponents; the others have r != s != t.
        seed: of the repertoire, apart from the seed of a data set.

    Raises:
        ConfigError: a range is empty, a share negative, or a part unknown or empty.
    """

    def __init__(
        self,
        families: Mapping[str, Family],
        sizes: Mapping[str, int],
        exponents: tuple[float, float] = (2.0, 100.0),
        paired: float = 0.5,
        seed: int = 0,
    ) -> None:
        _check_families(families)
        if not 1 <= exponents[0] <= exponents[1]:
            raise ConfigError(f"shape.exponents = {exponents}: expected 1 <= smallest <= largest")
        for part, size in sizes.items():
            if part not in _NUMBERS or size < 1:
                raise ConfigError(
                    f"shape.sizes.{part} = {size}: expected a size of at least 1 for "
                    f"{', '.join(_NUMBERS)}"
                )
        SHARE.require(paired=paired)
        NOT_NEGATIVE.require(seed=seed)
        self.families = {
            name: {"share": float(family["share"]), "extents": np.array(family["extents"])}
            for name, family in families.items()
        }
        self.sizes = dict(sizes)
        self.exponents = tuple(exponents)
        self.paired = paired
        self.seed = seed

    def sample(self, rng: np.random.Generator, split: str) -> Superquadric:
        """One shape of a part, each as likely.

        Raises:
            ConfigError: the library has no such part.
        """
        shapes = self.part(split)
        return shapes[int(rng.integers(len(shapes)))]

    def part(self, split: str) -> Sequence[Superquadric]:
        """All shapes of a part.

        Raises:
            ConfigError: the library has no such part.
        """
        if split not in self.sizes:
            raise ConfigError(f"the library has no shapes for {split}; give shape.sizes.{split}")
        return self._parts[split]

    @cached_property
    def _parts(self) -> dict[str, list[Superquadric]]:
        return {
            part: [Superquadric(*pair) for pair in zip(*self._draw(part, size), strict=True)]
            for part, size in self.sizes.items()
        }

    def _draw(self, part: str, size: int) -> tuple[Array, Array]:
        """Half-axes and exponents, (size, 3) each."""
        rng = streams.generator(self.seed, _NUMBERS[part])
        shares = np.array([family["share"] for family in self.families.values()])
        kinds = rng.choice(len(shares), size=size, p=shares / shares.sum())
        limits = np.array([family["extents"] for family in self.families.values()])[kinds]
        half_axes = rng.uniform(limits[..., 0], limits[..., 1]) / 2
        return single(half_axes), draw_exponents(rng, size, self.exponents, self.paired)


def _check_families(families: Mapping[str, Family]) -> None:
    if not sum(family["share"] for family in families.values()) > 0:
        raise ConfigError("shape.families: expected at least one family with a share above 0")
    for name, family in families.items():
        extents = np.array(family["extents"])
        if family["share"] < 0:
            raise ConfigError(f"shape.families.{name}.share = {family['share']}: expected >= 0")
        if extents.shape != (3, 2) or not (extents[:, 0] > 0).all():
            raise ConfigError(
                f"shape.families.{name}.extents: expected smallest and largest of three axes (m)"
            )
        if not (extents[:, 0] <= extents[:, 1]).all():
            raise ConfigError(f"shape.families.{name}.extents: expected smallest <= largest (m)")
