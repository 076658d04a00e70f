"""The repertoire of superquadrics of the thesis (5.2.1), one for all parts of a data set."""

from functools import cached_property

import numpy as np

from scenefw.core import rng as streams
from scenefw.core.errors import ConfigError
from scenefw.core.settings import COUNT, NOT_NEGATIVE, SHARE
from scenefw.shapes.superquadric import Array, Superquadric


class SuperquadricLibrary:
    """A fixed repertoire of superquadrics, from which scenes draw uniformly.

    Extents are uniform, exponents log-uniform (uniform ones would give almost only boxes). All
    parameters are exact in float32, the precision in which scenes are stored.

    Args:
        size: number of shapes.
        extents: smallest and largest full extent along each axis (m).
        exponents: smallest and largest exponent of eq. 5.1.
        paired: share of shapes with two equal exponents; the others have r != s != t.
        seed: of the repertoire, apart from the seed of a data set.

    Raises:
        ConfigError: a range is empty, an exponent below 1, or the library is empty.
    """

    def __init__(
        self,
        size: int = 3500,
        extents: tuple[float, float] = (0.05, 0.30),
        exponents: tuple[float, float] = (2.0, 100.0),
        paired: float = 0.5,
        seed: int = 0,
    ) -> None:
        COUNT.require(size=size)
        if not 0 < extents[0] <= extents[1]:
            raise ConfigError(f"shape.extents = {extents}: expected 0 < smallest <= largest (m)")
        if not 1 <= exponents[0] <= exponents[1]:
            raise ConfigError(f"shape.exponents = {exponents}: expected 1 <= smallest <= largest")
        SHARE.require(paired=paired)
        NOT_NEGATIVE.require(seed=seed)
        self.size = size
        self.extents = tuple(extents)
        self.exponents = tuple(exponents)
        self.paired = paired
        self.seed = seed

    def __len__(self) -> int:
        return self.size

    def __getitem__(self, index: int) -> Superquadric:
        half_axes, exponents = self._parameters
        return Superquadric(half_axes[index], exponents[index])

    def sample(self, rng: np.random.Generator, split: str | None = None) -> Superquadric:
        """One shape of the library, whatever part of a data set it is for."""
        del split
        return self[int(rng.integers(self.size))]

    @cached_property
    def _parameters(self) -> tuple[Array, Array]:
        rng = streams.generator(self.seed)
        half_axes = rng.uniform(self.extents[0], self.extents[1], size=(self.size, 3)) / 2
        return single(half_axes), draw_exponents(rng, self.size, self.exponents, self.paired)


def draw_exponents(
    rng: np.random.Generator, size: int, limits: tuple[float, ...], paired: float
) -> Array:
    """Log-uniform exponents (size, 3); of a share `paired` of the rows, two are equal."""
    lower, upper = np.log(limits)
    exponents = np.exp(rng.uniform(lower, upper, size=(size, 3)))
    pairs = np.flatnonzero(rng.random(size) < paired)
    first = rng.integers(3, size=len(pairs))
    exponents[pairs, first] = exponents[pairs, (first + 1) % 3]
    return single(exponents)


def single(array: Array) -> Array:
    """The numbers rounded to float32, the precision in which scenes are stored."""
    return array.astype(np.float32).astype(np.float64)
