"""What the strategies share: height maps with labels put on them, states that are gone on with."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import InputError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labels import NO_SOURCE, UNKNOWN
from scenefw.core.protocols import HeightMapping, RunningHeights, RunningLabels, SemanticMapping
from scenefw.core.types import Float32

Sources = NDArray[np.uint8]
State = Mapping[str, NDArray[Any]]
States = Mapping[str, State]
Share = Callable[[str, Any], Any]
"""From the name of a part and the part to what a strategy should use in its place."""

KEY_FRAMES, MAP_LABELS = "key_frames", "map_labels"
"""Names of states beside those of the fusions."""

_TOLERANCE = 1e-6  # float32 probabilities this close to uniform say nothing


def known(probabilities: Float32) -> NDArray[np.bool_]:
    """(V, V) where probabilities (C, V, V) say anything: they are not uniform."""
    return np.asarray(probabilities.max(axis=0) > 1 / len(probabilities) + _TOLERANCE)


def labelled(
    height_map: HeightMap, probabilities: Float32, classes: Sequence[str], sources: Sources | int
) -> HeightMap:
    """The map with the most probable class of each vertex that has a height and is known.

    Args:
        height_map: without labels.
        probabilities: (C, V, V).
        classes: their names.
        sources: where labels come from (`core.labels`), (V, V) or one for all.
    """
    named = height_map.seen & known(probabilities)
    labels = np.where(named, probabilities.argmax(axis=0), UNKNOWN).astype(np.int32)
    origin = np.where(named, sources, NO_SOURCE).astype(np.uint8)
    return replace(
        height_map,
        probabilities=probabilities,
        labels=labels,
        sources=origin,
        classes=tuple(classes),
    )


def unlabelled(height_map: HeightMap, classes: Sequence[str]) -> HeightMap:
    """The map with every vertex unknown."""
    shape = (len(classes), *height_map.grid.shape)
    uniform = np.full(shape, 1 / len(classes), np.float32)
    return labelled(height_map, uniform, classes, NO_SOURCE)


def require_classes(previous: HeightMap | None, classes: Sequence[str]) -> None:
    """Checks that a map to go on with has the classes of the labels to come.

    Raises:
        InputError: it has others.
    """
    if previous is not None and previous.classes and tuple(previous.classes) != tuple(classes):
        raise InputError(
            f"the map has the classes {', '.join(previous.classes)}, the label source "
            f"{', '.join(classes)}; go on with the checkpoint that labelled it, or start a new map"
        )


def begin_heights(
    mapping: HeightMapping, previous: HeightMap | None, states: States | None
) -> RunningHeights:
    """Height fusion that starts, goes on roughly (a map alone) or exactly (its state too)."""
    if states and "heights" in states:
        return mapping.begin(previous, state=states["heights"])  # type: ignore[call-arg]
    return mapping.begin(previous)


def begin_labels(
    mapping: SemanticMapping,
    grid: HeightGrid,
    classes: int,
    previous: HeightMap | None,
    states: States | None,
) -> RunningLabels:
    """Label fusion that starts, or goes on as `begin_heights` does."""
    if states and "labels" in states:
        return mapping.begin(grid, classes, state=states["labels"])  # type: ignore[call-arg]
    return mapping.begin(grid, classes, None if previous is None else previous.probabilities)


class MapLabels:
    """Labels of the map, made anew at every so many frames.

    Args:
        every: frames; None = whenever the map is asked for.
        states: of a saved labelling that is gone on with.

    Attributes:
        latest: what was last made, arrays by name.
    """

    def __init__(self, every: int | None, states: States | None) -> None:
        state = (states or {}).get(MAP_LABELS, {})
        self.every = every
        self.frames = int(state.get("frames", 0))
        self.latest: State = {key: value for key, value in state.items() if key != "frames"}

    def due(self) -> bool:
        """Counts a frame; whether labels are to be made after it."""
        self.frames += 1
        return self.every is not None and self.frames % self.every == 0

    def state(self) -> dict[str, NDArray[Any]]:
        """What to save for going on exactly; nothing where labels are made when asked for."""
        return {} if self.every is None else {"frames": np.array(self.frames), **self.latest}


def states_of(**running: Any) -> dict[str, dict[str, NDArray[Any]]]:
    """What fusion needs to go on exactly, by part; parts that keep no state are left out."""
    return {name: dict(part.state()) for name, part in running.items() if hasattr(part, "state")}
