"""What is known of an object over the images of a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from scenefw.core.types import Float32, Float64, Int32, ObjectEstimate
    from scenefw_tracking.depth_memory import Box, DepthMemory
    from scenefw_tracking.rigid_motion import Motion

    Mask = NDArray[np.bool_]


class State(StrEnum):
    """What an object did from the image before to this one."""

    NEW = "new"  # it wasn't there
    STILL = "still"
    MOVED = "moved"
    HIDDEN = "hidden"  # something else is in front of all of it
    GONE = "gone"


@dataclass(frozen=True, eq=False)
class Appearance:
    """How a still camera sees an object that lies still.

    Args:
        box: of the image, in which its pixels are.
        pixels: (h, w) of the box that show it, if nothing else does.
        memory: of the box.
    """

    box: Box
    pixels: Mask
    memory: DepthMemory

    @classmethod
    def of(cls, mask: Mask, memory: DepthMemory) -> Appearance | None:
        """The appearance of an object whose pixels (H, W) are these; None of one without any."""
        rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return None
        box = (
            slice(int(rows[0]), int(rows[-1]) + 1),
            slice(int(columns[0]), int(columns[-1]) + 1),
        )
        return cls(box, mask[box], memory[box])

    def is_contradicted(self, depth: Float32) -> bool:
        """Whether a depth image (H, W) shows what is behind the object, where it should be."""
        return bool(self.memory.farther(depth[self.box], self.pixels).any())

    def is_visible(self, depth: Float32) -> bool:
        """Whether a depth image (H, W) shows some of it."""
        return bool(self.memory.cleaned(self.pixels & self.memory.matches(depth[self.box])).any())

    def is_same(self, depth: Float32) -> bool:
        """Whether a depth image (H, W) shows all of it again."""
        crop = depth[self.box]
        hidden = self.memory.cleaned(self.memory.nearer(crop) & self.pixels)
        return self.is_visible(depth) and not (hidden.any() or self.is_contradicted(depth))

    def mask(self, depth: Float32) -> Mask:
        """Its pixels (H, W), but for those that show something in front of it."""
        mask = np.zeros(depth.shape, dtype=bool)
        mask[self.box] = self.pixels & ~self.memory.nearer(depth[self.box])
        return mask


@dataclass(frozen=True, eq=False)
class Track:
    """An object over time.

    Args:
        id: the same in all images.
        item: its most typical shape, in the coordinates of all images.
        appearance: where it lies, or lay before it was gone; None: no image shows it there.
        state: in the last image.
        since: name of the image since which it is in this state; of one that stands still, since
            which it is where it is.
        placed: name of the image since which it is where it is.
        motion: rigid 4x4 that brought it there from its place before; None: it hasn't moved.
    """

    id: int
    item: ObjectEstimate
    appearance: Appearance | None
    state: State
    since: str
    placed: str
    motion: Float64 | None = None

    @classmethod
    def new(cls, item: ObjectEstimate, appearance: Appearance | None, name: str) -> Track:
        """The track of an object that an image shows first."""
        return cls(item.id, item, appearance, State.NEW, name, name)

    @property
    def visible_part(self) -> Appearance | None:
        """How a still camera sees it, if it is there and nothing is in front of it."""
        return self.appearance if self.is_present else None

    @property
    def is_present(self) -> bool:
        """Whether it is there, visible or not."""
        return self.state != State.GONE

    def at_rest(self, depth: Float32, name: str) -> Track:
        """The track after an image that doesn't contradict it."""
        if self.appearance is None or not self.appearance.is_visible(depth):
            return self.hidden(name)
        return replace(self, state=State.STILL, since=self.placed, motion=None)

    def hidden(self, name: str) -> Track:
        """The track after an image in which something else is in front of it."""
        since = self.since if self.state == State.HIDDEN else name
        return replace(self, state=State.HIDDEN, since=since, motion=None)

    def gone(self, name: str) -> Track:
        """The track after an image that shows what is behind it."""
        if self.state == State.GONE:
            return replace(self, motion=None)
        return replace(self, state=State.GONE, since=name, motion=None)

    def continued(self, update: Track, motion: Motion, depth: Float32, name: str) -> Track:
        """The track with a new shape and place, where `motion` has brought it by an image."""
        is_same = self.appearance is not None and self.appearance.is_same(depth)
        track = replace(self, item=update.item, appearance=update.appearance)
        if not (is_same or motion.is_rest):
            return replace(track, state=State.MOVED, since=name, placed=name, motion=motion.matrix)
        placed = name if self.state == State.GONE else self.placed
        return replace(track, state=State.STILL, since=placed, placed=placed, motion=None)

    def facts(self) -> dict[str, Any]:
        """Plain data: id, state, since which image, and how it moved to this one."""
        facts = {"id": self.id, "state": str(self.state), "since": self.since}
        if self.motion is None:
            return facts
        return {**facts, "motion": self.motion.tolist()}


def masks_of(tracks: Iterable[Track], depth: Float32) -> Int32:
    """(H, W) id of the object that each pixel of an image shows, 0 = none."""
    masks = np.zeros(depth.shape, np.int32)
    for track in tracks:
        if track.visible_part is not None:
            masks[track.visible_part.mask(depth)] = track.id
    return masks
