"""What `Settling` says of a scene that came to rest: `SceneEstimate.details["settled"]`."""

from typing import NotRequired, TypedDict

from scenefw.core.types import SceneEstimate


class SettledObject(TypedDict):
    """How one object came to rest; it `moved` and `turned`, or `stays`, or stays after it did."""

    id: int
    """As in `ObjectEstimate`."""
    moved: NotRequired[float]
    """Distance of its centre of mass from where it was (m)."""
    turned: NotRequired[float]
    """Degrees."""
    stays: NotRequired[str]
    """Why it was put back to where it had been, or never moved."""
    collides_as: NotRequired[str]
    """The shape that the simulator took for it, in words."""


class Settled(TypedDict):
    """How a scene came to rest."""

    objects: list[SettledObject]
    """By id; empty if there was nothing to settle."""
    stable: bool
    """Whether all objects stood; a drawn scene that isn't stable is drawn anew."""
    displacement: NotRequired[float | None]
    """Mean of `moved` (m); None if nothing could move."""
    hypothesis: NotRequired[int]
    """The scene's number, from 1, among those that were given."""
    reason: NotRequired[str]
    """Why nothing was settled; there if `objects` is empty."""


def words(scene: SceneEstimate) -> str:
    """One line: how far the objects of a settled scene moved, and which stayed, and why."""
    facts = scene.details["settled"]
    parts = []
    for row in facts["objects"]:
        distance = f"{100 * row['moved']:.1f} cm and {row['turned']:.0f}°" if "moved" in row else ""
        stays = f"stays as it was ({row['stays']})" if "stays" in row else f"moved {distance}"
        parts.append(f"object {row['id']} {stays}")
    return "settled: " + ("; ".join(parts) or facts["reason"])
