"""What the strategies share: saved states to resume from, and labels of the whole map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.height_maps import HeightMap
    from scenefw.core.labelling_protocols import State, States

HEIGHTS, LABELS, KEY_FRAMES, MAP_LABELS = "heights", "labels", "key_frames", "map_labels"
"""Names of the states of running parts in a saved map."""


def require_classes(previous: HeightMap | None, classes: Sequence[str]) -> None:
    """Checks that a map to resume has the classes of the labels to come.

    Raises:
        InputError: it has others.
    """
    if previous is not None and previous.classes and tuple(previous.classes) != tuple(classes):
        raise InputError(
            f"the map has the classes {', '.join(previous.classes)}, the label source "
            f"{', '.join(classes)}; resume with the checkpoint that labelled it, or start a new map"
        )


def state_of(part: str, states: States | None) -> State | None:
    """The saved state of a part; None if none was kept."""
    return (states or {}).get(part) or None


class MapLabels:
    """Labels of the map, renewed every N frames.

    Args:
        interval: frames; None = whenever the map is requested.
        states: of a saved labelling, to resume from.

    Attributes:
        latest: the latest labels and what belongs to them, arrays by name.
    """

    def __init__(self, interval: int | None, states: States | None) -> None:
        state = state_of(MAP_LABELS, states) or {}
        self.interval = interval
        self.frames = int(state.get("frames", 0))
        self.latest: State = {key: value for key, value in state.items() if key != "frames"}

    def due(self) -> bool:
        """Counts a frame; whether the map is to be labelled after it."""
        self.frames += 1
        return self.interval is not None and self.frames % self.interval == 0

    def state(self) -> State:
        """What to resume from; empty if the map is labelled on request."""
        return {} if self.interval is None else {"frames": np.array(self.frames), **self.latest}
