"""How large objects are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from scenefw.shapes.moments import moments

if TYPE_CHECKING:
    from scenefw.core.types import ObjectEstimate, TriangleMesh


def size(item: ObjectEstimate) -> str:
    """Extents of an object in centimetres."""
    return " × ".join(f"{100 * side:.0f}" for side in item.extents) + " cm"


def volume(mesh: TriangleMesh) -> float:
    """What a mesh holds (m^3)."""
    return abs(moments(mesh).volume)
