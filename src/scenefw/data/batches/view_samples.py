"""How much of a view networks of sets are shown: the same in training and afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

POINTS_OF_VIEW = 1024
"""Points that a decoder of sets is shown of a view, unless its weights say otherwise."""

WIDTH_OF_VIEW = 128
"""Pixels along the images that decoders of sets see, unless their weights say otherwise."""

# Keys in the metadata of weights
_OBJECTS, _VIEW, _WIDTH = "samples_of_objects", "points_of_view", "width_of_view"


@dataclass(frozen=True)
class ObjectSamples:
    """What a flow of sets is shown of each object; the defaults are for weights that don't say it.

    Args:
        points: of its surface; with fewer than in training, objects end before they do.
        ends: of its image.
        width: of the image (pixels).
    """

    points: int = 192
    ends: int = 48
    width: int = 128

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> ObjectSamples:
        """As the network of these metadata was trained."""
        return cls(**metadata.get(_OBJECTS, {}))

    def facts(self) -> dict[str, Any]:
        """For the metadata."""
        return {_OBJECTS: asdict(self)}


def points_of_view(metadata: Mapping[str, Any]) -> int:
    """Points of a view that the decoder of these metadata was trained with."""
    return int(metadata.get(_VIEW, POINTS_OF_VIEW))


def view_facts(points: int) -> dict[str, Any]:
    """The number of points for the metadata."""
    return {_VIEW: points}


def width_of_view(metadata: Mapping[str, Any]) -> int:
    """Width of the images (pixels) that the decoder of these metadata was trained with."""
    return int(metadata.get(_WIDTH, WIDTH_OF_VIEW))


def image_facts(width: int) -> dict[str, Any]:
    """The width of images for the metadata."""
    return {_WIDTH: width}
