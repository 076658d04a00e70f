"""How much of a view networks of sets are shown: the same in training and afterwards."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

_OBJECTS = "samples_of_objects"  # key in the metadata of weights


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
