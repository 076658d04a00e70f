"""Protocols of labelling: table-top scenes and their views, fusion into height maps, labels.

What runs over a sequence of frames comes in two parts: settings, whose `begin` starts a sequence,
and a running part, which grows frame by frame and whose `state` is saved with the map. `begin`
takes that state back and then continues as if never interrupted. A part without anything to save
returns an empty state; it is then resumed from the saved map alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from scenefw.core.height_maps import HeightGrid, HeightMap
    from scenefw.core.tabletop import TabletopGeometry, TabletopScene, TexturedMesh
    from scenefw.core.types import Camera, Float32, Frame

State: TypeAlias = Mapping[str, NDArray[Any]]
"""Arrays of one running part by name; empty if it keeps nothing."""

States: TypeAlias = Mapping[str, State]
"""States of running parts by name."""


class TabletopModels(Protocol):
    """Models by class and instance (group `shape`, options `tabletop*` and `shapenet`)."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def instances(self, label: int, split: str) -> Sequence[int]:
        """Indices of the instances of a class in a split."""

    def model(self, label: int, instance: int) -> TexturedMesh:
        """One model; always the same for the same arguments."""


class TabletopSource(Protocol):
    """Makes table-top scenes (group `scene`, options `tabletop*`)."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def numbers(self, split: str) -> Sequence[int]:
        """Indices of the scenes of a split."""

    def generate(self, index: int, seed: int) -> TabletopScene:
        """Scene number `index` of the data set `seed`."""

    def geometry(self, scene: TabletopScene) -> TabletopGeometry:
        """The triangles of a scene."""


class TabletopRenderer(Protocol):
    """Colour, depth and labels of table-top scenes (group `renderer`)."""

    def fingerprint(self) -> str:
        """A key that changes with everything that changes the images."""

    def frames(self, geometry: TabletopGeometry, cameras: Sequence[Camera]) -> Iterator[Frame]:
        """One frame per camera: z-depth (0 = nothing), colour, class ids."""

    def height_map(self, geometry: TabletopGeometry, grid: HeightGrid) -> HeightMap:
        """The scene from straight above, every vertex seen."""


class FrameSource(Protocol):
    """Scenes with RGB-D views and, where known, ground truth (group `dataset`, `tabletop*`)."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def __len__(self) -> int:
        """Number of scenes."""

    def frames(self, scene: int, count: int, start: int = 0) -> Iterator[Frame]:
        """Views start to start + count - 1 of a scene; view i is always the same."""

    def truth(self, scene: int) -> HeightMap:
        """Orthographic heights, colour and labels of the scene."""


class Odometry(Protocol):
    """Estimates the camera poses of a sequence (group `odometry`)."""

    def track(self, frames: Iterable[Frame]) -> Iterator[Frame]:
        """The frames with poses relative to the first camera; existing poses are ignored."""


class RunningHeights(Protocol):
    """A height map that grows frame by frame."""

    def add(self, frame: Frame) -> None:
        """Fuses depth and colour of a frame, whose camera's pose is in the world frame."""

    def height_map(self) -> HeightMap:
        """The map of all frames so far."""

    def state(self) -> State:
        """What `begin` resumes from; may be empty."""


@runtime_checkable
class HeightMapping(Protocol):
    """Fuses frames into height maps (group `heights`).

    Maps that are kept are named by its public attributes (`core.made_of`), so all that changes a
    map is in one of these.
    """

    @property
    def grid(self) -> HeightGrid:
        """The grid of its maps."""

    def begin(
        self, previous: HeightMap | None = None, state: State | None = None
    ) -> RunningHeights:
        """Starts a map or resumes one.

        Args:
            previous: an earlier map to start from; not read if there is a state.
            state: of `RunningHeights.state`, to resume exactly; None if none was kept.
        """


class RunningLabels(Protocol):
    """Class probabilities of vertices, refined frame by frame."""

    def add(self, probabilities: Float32, frame: Frame, heights: HeightMap | None) -> None:
        """Fuses the labels of a frame; pixels without depth are skipped.

        Args:
            probabilities: (C, H, W) float32, summing to 1 over the classes.
            frame: the view that they label.
            heights: a recent map; None only if the fusion's `reads_map` is False.
        """

    def probabilities(self) -> Float32:
        """(C, V, V), uniform where no frame has labelled the vertex."""

    def state(self) -> State:
        """What `begin` resumes from; may be empty."""


@runtime_checkable
class SemanticMapping(Protocol):
    """Fuses labelled views into the vertices of a height map (setting `semantics`)."""

    @property
    def reads_map(self) -> bool:
        """Whether `add` needs the height map as well as the frame."""

    def begin(
        self,
        grid: HeightGrid,
        classes: int,
        previous: Float32 | None = None,
        state: State | None = None,
    ) -> RunningLabels:
        """Starts from uniform probabilities or resumes.

        Args:
            grid: the vertices.
            classes: C.
            previous: (C, V, V) of an earlier map to start from; not read if there is a state.
            state: of `RunningLabels.state`, to resume exactly; None if none was kept.
        """


@runtime_checkable
class LabelSource(Protocol):
    """Labels the pixels of a frame (group `label_source`): network, mask files or ground truth."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def label(self, frame: Frame) -> Float32:
        """Probabilities (C, H, W), summing to 1 over the classes."""


@runtime_checkable
class MapLabelSource(Protocol):
    """Labels the vertices of a height map (group `label_source`)."""

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def label_map(self, height_map: HeightMap) -> Float32:
        """Probabilities (C, V, V), summing to 1; uniform where the map is unseen.

        Args:
            height_map: only heights, colour, confidence and variance are read.
        """


class RunningKeyFrames(Protocol):
    """Decides frame by frame which ones are labelled."""

    def takes(self, frame: Frame) -> bool:
        """Whether the next frame of the sequence is a key frame."""

    def state(self) -> State:
        """What `begin` resumes from; may be empty."""


class KeyFrames(Protocol):
    """A schedule of key frames (group `key_frames`)."""

    def begin(self, state: State | None = None) -> RunningKeyFrames:
        """Starts a sequence, whose first frame is a key frame, or resumes one.

        Args:
            state: of `RunningKeyFrames.state`, maybe of another schedule; None if none was kept.
        """


class RunningLabelling(Protocol):
    """A labelled height map that grows frame by frame."""

    def add(self, frame: Frame) -> None:
        """Adds the next frame."""

    def height_map(self) -> HeightMap:
        """The map so far with probabilities, labels, sources and classes."""

    def states(self) -> States:
        """What `begin` resumes from, by part; may be empty."""


class Labelling(Protocol):
    """A strategy for labelling a scene from many views (group `labelling`).

    Strategies that are compared side by side share the work of equal parts if they are
    dataclasses: fields that hold a `HeightMapping`, `SemanticMapping`, `LabelSource` or
    `MapLabelSource` are then replaced by `dataclasses.replace`. Any other class runs separately.
    """

    @property
    def classes(self) -> Sequence[str]:
        """Names by class id."""

    def begin(
        self, previous: HeightMap | None = None, states: States | None = None
    ) -> RunningLabelling:
        """Starts a scene or resumes a saved one.

        Args:
            previous: the map so far.
            states: of `RunningLabelling.states`, to resume exactly. They may hold states of
                other parts, which are ignored.

        Raises:
            InputError: the map has other classes.
        """
