"""Contacts of objects in words, for warnings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.perception.estimate.contacts import hovers, overlaps
from scenefw.perception.observation.components import DETAIL

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.types import ObjectEstimate


def contact_words(objects: Sequence[ObjectEstimate], tolerance: float = DETAIL) -> list[str]:
    """A line for each overlap and each object that nothing carries; none if all is well."""
    lines = []
    for overlap in overlaps(objects, tolerance):
        depth = f"{1000 * overlap.depth:.0f} mm"
        if overlap.second == 0:
            lines.append(f"object {overlap.first} reaches {depth} below the floor")
        else:
            lines.append(
                f"objects {overlap.first} and {overlap.second} run into each other by {depth} "
                f"({1e6 * overlap.volume:.0f} cm³)"
            )
    for hover in hovers(objects, tolerance):
        below = f"object {hover.below}" if hover.below else "the floor"
        lines.append(f"object {hover.id} hovers {1000 * hover.gap:.0f} mm above {below}")
    return lines
