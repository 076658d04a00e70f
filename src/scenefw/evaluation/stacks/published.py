"""Table 5.1 of the thesis, to print beside our figures.

Source of the table: "Scene Understanding for 3D Multi-Object Scenes: Labelling, Reasoning and
Decomposing", PhD thesis, Imperial College London, Department of Computing, table 5.1 (1419 test
scenes of superquadrics, 256 of YCB objects, 3 viewpoints each; 3 latent samples per view for its
own method). What its sigmas are taken over is not said there. Its Chamfer distances are from 1000
points per surface, so most of each is the floor of that sampling.
"""

from collections.abc import Mapping
from typing import NamedTuple

from scenefw.core.errors import ConfigError

VIEWS = 3


class Figure(NamedTuple):
    """A published mean with its sigma."""

    mean: float
    sigma: float


SUPERQUADRICS: dict[str, dict[str, Figure]] = {
    "SIMstack": {
        "chamfer_visible": Figure(0.016, 0.0002),
        "chamfer_full": Figure(0.028, 0.0003),
        "occupancy_bce": Figure(0.089, 0.003),
        "displacement": Figure(0.593, 1.28),
    },
    "FC": {
        "chamfer_visible": Figure(0.044, 0.002),
        "chamfer_full": Figure(0.062, 0.107),
        "occupancy_bce": Figure(0.175, 0.005),
        "displacement": Figure(1.112, 5.441),
    },
    "SSCNet**": {
        "chamfer_visible": Figure(0.036, 0.002),
        "chamfer_full": Figure(0.03, 0.002),
        "occupancy_bce": Figure(0.247, 0.008),
    },
}
"""By method and figure: Chamfer and displacement in metres, BCE in nats."""

YCB: dict[str, dict[str, Figure]] = {
    "SIMstack": {
        "chamfer_visible": Figure(0.036, 0.002),
        "chamfer_full": Figure(0.062, 0.007),
        "occupancy_bce": Figure(0.112, 0.006),
        "displacement": Figure(1.216, 4.734),
    },
    "FC": {
        "chamfer_visible": Figure(0.076, 0.006),
        "chamfer_full": Figure(0.098, 0.011),
        "occupancy_bce": Figure(0.236, 0.029),
        "displacement": Figure(1.756, 6.494),
    },
    "SSCNet**": {
        "chamfer_visible": Figure(0.065, 0.008),
        "chamfer_full": Figure(0.116, 0.009),
        "occupancy_bce": Figure(0.242, 0.015),
    },
}
"""As `SUPERQUADRICS`, on stacks of YCB objects."""


class Published(NamedTuple):
    """What the thesis has for a data set: figures by method, and of how many scenes."""

    figures: Mapping[str, Mapping[str, Figure]]
    scenes: int


_OF = {"superquadrics": Published(SUPERQUADRICS, 1419), "ycb": Published(YCB, 256)}
_NONE = Published({}, 0)


def published_of(data: str | None) -> Published:
    """The figures of a data set, `superquadrics` or `ycb`; None has none.

    Raises:
        ConfigError: the thesis has no such data set.
    """
    if data is None:
        return _NONE
    if data not in _OF:
        raise ConfigError(
            f"evaluation.published = {data}: table 5.1 has {', '.join(_OF)}; give one, or null"
        )
    return _OF[data]


def thesis_figures(data: str | None) -> Mapping[str, Figure]:
    """The figures of the thesis's own method on a data set, by name."""
    return published_of(data).figures.get("SIMstack", {})
