"""What stands on what, what falls if something goes, and in which order to take things away."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from scenefw.core.weak_cache import cached_by_identity
from scenefw.perception.estimate.base_frame import on_floor
from scenefw.perception.estimate.contacts import Overlap, shared_places
from scenefw.perception.evidence.mesh_distances import MeshDistances, distances_to
from scenefw.perception.observation.components import DETAIL
from scenefw.perception.observation.points import MAJORITY
from scenefw.shapes.moments import moments

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from scenefw.core.types import Float64, ObjectEstimate, SceneEstimate


@dataclass(frozen=True, eq=False)
class SupportGraph:
    """Contacts of objects with what is below them, and what follows for taking them away.

    An object is carried while its centre of mass lies over the convex hull of the places at which
    it touches what is below it. So a pile that holds together by friction alone counts as fallen.

    Args:
        contacts: places (N, 2) of the floor (m) at which an object, by id, rests on others, by id;
            `FLOOR` is one of them.
        centres: (2,) place of the centre of mass of each object (m).
        heights: of the top of each object (m).
    """

    FLOOR: ClassVar[int] = Overlap.FLOOR

    contacts: Mapping[int, Mapping[int, Float64]]
    centres: Mapping[int, Float64]
    heights: Mapping[int, float]

    @cached_property
    def stands_on(self) -> dict[int, tuple[int, ...]]:
        """What each object touches from above; `FLOOR` for the floor, nothing if it hovers."""
        return {label: tuple(sorted(below)) for label, below in self.contacts.items()}

    def support_of(self, label: int) -> str:
        """What an object stands on, in words: `floor, 3`; nothing if it hovers."""
        return ", ".join("floor" if k == self.FLOOR else str(k) for k in self.stands_on[label])

    def falls(self, label: int, gone: Collection[int] = ()) -> tuple[int, ...]:
        """Objects that nothing carries any more if one goes, and those that fall with them.

        Args:
            label: id of the object that goes.
            gone: ids of objects that went before.
        """
        missing = {*gone, label}
        while True:
            fallen = {
                item
                for item, below in self.contacts.items()
                if item not in missing
                and missing & below.keys()
                and not self._stands(item, missing)
            }
            if not fallen:
                return tuple(sorted(missing - {*gone, label}))
            missing |= fallen

    def removal_order(self) -> tuple[int, ...]:
        """Ids in an order in which each is taken when as few as possible fall with it.

        Of several the highest goes first.
        """
        order: list[int] = []
        while len(order) < len(self.contacts):
            remaining = [label for label in self.contacts if label not in order]
            costs = [(len(self.falls(k, order)), -self.heights[k], k) for k in remaining]
            order.append(min(costs)[-1])
        return tuple(order)

    def facts(self) -> dict[str, Any]:
        """Plain data: of each object what it stands on and what falls with it; removal order."""
        return {
            "objects": [
                {"id": label, "stands_on": list(below), "falls": list(self.falls(label))}
                for label, below in self.stands_on.items()
            ],
            "removal_order": list(self.removal_order()),
        }

    def _stands(self, label: int, missing: Collection[int]) -> bool:
        remaining = tuple(below for below in self.contacts[label] if below not in missing)
        if (label, remaining) not in self._standing:  # asked again for each order of removal
            places = [self.contacts[label][below] for below in remaining]
            stands = bool(places) and _over(self.centres[label], np.concatenate(places))
            self._standing[label, remaining] = stands
        return self._standing[label, remaining]

    @cached_property
    def _standing(self) -> dict[tuple[int, tuple[int, ...]], bool]:
        """Whether an object stands on some of what it touches, as far as that was computed."""
        return {}


def support_graph(objects: Sequence[ObjectEstimate]) -> SupportGraph:
    """The support graph of a scene.

    Args:
        objects: closed meshes, world coordinates (z up, floor z = 0).
    """
    solids = {item.id: distances_to(item.mesh) for item in objects}
    return SupportGraph(
        {label: _contacts(label, solids) for label in solids},
        {item.id: moments(item.mesh).pose.position[:2] for item in objects},
        {label: float(solid.high[2]) for label, solid in solids.items()},
    )


@cached_by_identity
def supports_of(estimate: SceneEstimate) -> SupportGraph:
    """The support graph of an estimate, computed once: several files of a scene hold it."""
    return support_graph(on_floor(estimate))


def _contacts(label: int, solids: Mapping[int, MeshDistances]) -> dict[int, Float64]:
    upper = solids[label]
    contacts: dict[int, Float64] = {}
    rests = _rests(upper)
    if upper.low[2] <= DETAIL:
        vertices = upper.vertices
        contacts[SupportGraph.FLOOR] = vertices[vertices[:, 2] <= upper.low[2] + DETAIL, :2]
    for below, lower in solids.items():
        if below == label:
            continue
        if lower not in rests:
            rests[lower] = _touching(upper, lower)
        if len(rests[lower]):
            contacts[below] = rests[lower]
    return contacts


@cached_by_identity
def _rests(upper: MeshDistances) -> WeakKeyDictionary[MeshDistances, Float64]:
    """Where a solid rests on others, as far as that was computed."""
    return WeakKeyDictionary()


def _touching(upper: MeshDistances, lower: MeshDistances) -> Float64:
    """Places (N, 2) at which one solid rests on another (m)."""
    apart = (lower.high[:2] < upper.low[:2]).any() or (lower.low[:2] > upper.high[:2]).any()
    if apart or lower.low[2] > upper.high[2] or lower.high[2] < upper.low[2] - DETAIL:
        return np.zeros((0, 2))
    places = shared_places(upper, lower)
    bottom, top = upper.lowest(places), lower.highest(places)
    touches = bottom - top <= DETAIL
    places, bottom, top = places[touches], bottom[touches], top[touches]
    if not len(places):
        return places
    is_below = lower.lowest(places) < bottom - DETAIL
    # What rises into more than half of a thing's height stands beside it
    carries = top - bottom < MAJORITY * (upper.highest(places) - bottom)
    return np.asarray(places[is_below & carries])


def _over(place: Float64, points: Float64) -> bool:
    """Whether a place (2,) lies in the convex hull of points (N, 2)."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # a point or a line, on which nothing stands
        return False
    return bool((hull.equations[:, :2] @ place + hull.equations[:, 2] <= 0).all())
