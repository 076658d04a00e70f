"""The thousand compounds that come with PyBullet's data, each of a few convex parts."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from scenefw.core.errors import MissingDependencyError
from scenefw.core.quiet import silenced
from scenefw.core.types import Float64
from scenefw_things.shapes.family import family
from scenefw_things.shapes.solids import Part, painted

_SCALE = 0.015  # metres per unit, of their URDF files
_COUNT = 1000


@family(number=(0, _COUNT - 0.01))
def bullet_compound(rng: np.random.Generator, *, number: float) -> list[Part]:
    """Compound `number`, rounded down, of `random_urdfs`; its parts have narrow gaps between them.

    Raises:
        MissingDependencyError: PyBullet isn't installed.
    """
    del rng
    return [
        part for i, solid in enumerate(_convex_parts(int(number))) for part in painted(i % 3, solid)
    ]


@lru_cache(maxsize=_COUNT)
def _convex_parts(number: int) -> tuple[Float64, ...]:
    path = data_folder() / "random_urdfs" / f"{number:03d}" / f"{number:03d}.obj"
    parts: list[list[list[float]]] = []
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith("o "):
            parts.append([])
        elif line.startswith("v "):
            parts[-1].append([float(word) for word in line.split()[1:4]])
    return tuple(_SCALE * np.array(corners) for corners in parts)


def data_folder() -> Path:
    """The folder of PyBullet's data.

    Raises:
        MissingDependencyError: PyBullet isn't installed.
    """
    try:
        with silenced():
            import pybullet_data
    except ImportError as error:
        raise MissingDependencyError(
            "compounds and robots of PyBullet's data need pybullet: "
            "pip install 'scenefw[simulation]'"
        ) from error
    return Path(pybullet_data.getDataPath())
