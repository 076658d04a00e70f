"""One small protocol per component group; tensors are batched, channels first, on one device."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import numpy as np
    import torch
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.batches import CameraBatch, PartialTSDF, SceneParameters, SceneVolumes
    from scenefw.core.height_maps import HeightGrid, HeightMap
    from scenefw.core.types import Frame, GridSpec, Pose, Scene, SceneObject, Shape


class ShapeSource(Protocol):
    """Where scenes take their shapes from (group `shape`)."""

    def sample(self, rng: np.random.Generator) -> Shape:
        """One random shape."""


class Engine(Protocol):
    """A rigid-body simulator holding one scene on the floor z = 0 (group `engine`)."""

    def reset(self) -> None:
        """Empties the world."""

    def add(self, item: SceneObject) -> int:
        """Adds an object and returns its handle."""

    def remove(self, handle: int) -> None:
        """Takes an object out."""

    def overlaps(self, handle: int) -> bool:
        """Whether the object touches another object or the floor where it is now."""

    def settle(self, max_steps: int) -> bool:
        """Simulates until everything rests, at most `max_steps` steps; whether it came to rest."""

    def simulate(self, steps: int) -> None:
        """Simulates exactly `steps` steps."""

    def pose(self, handle: int) -> Pose:
        """Pose of the object now."""


class SceneSource(Protocol):
    """Makes scenes (group `scene`)."""

    def generate(self, index: int, seed: int) -> Scene | None:
        """Attempt number `index` of the data set `seed`; None if the attempt failed."""


class SceneBatch(Protocol):
    """B scenes of which volumes are made, on one device."""

    parameters: SceneParameters
    grid: GridSpec

    @property
    def volumes(self) -> SceneVolumes:
        """Their exact distances, votes and instances, computed when first read, and once."""


class Representation(Protocol):
    """A volume that describes scenes, which networks learn to give (group `representation`)."""

    channels: int

    def of_scenes(self, scenes: SceneBatch) -> Tensor:
        """(B, channels, X, Y, Z) of B scenes in its own units, on their device."""

    def to_network(self, volume: Tensor, grid: GridSpec) -> Tensor:
        """What losses compare a network's output with, float32, of a volume of `of_scenes`."""

    def from_network(self, output: Tensor, grid: GridSpec) -> Tensor:
        """A network's output (..., channels, X, Y, Z) in the units of `of_scenes`, float32."""


class Renderer(Protocol):
    """Depth images of TSDF grids (group `renderer`)."""

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of TSDFs (B, 1, X, Y, Z) in metres; 0 = nothing hit."""


class MappingMethod(Protocol):
    """Fuses depth images into a partial TSDF (group `mapping`)."""

    def fuse(self, depth: Tensor, grid: GridSpec, cameras: CameraBatch) -> PartialTSDF:
        """Partial TSDF of each of B depth images (B, H, W), metres, 0 = no measurement."""


class Noise(Protocol):
    """Disturbs depth images as a sensor does (group `noise`)."""

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0.

        Args:
            depth: (B, H, W) metres.
            cameras: one per image.
            seeds: (B,) int64, 0 or more, on the device of the depth: each image's noise is a
                function of its own seed, whatever stands beside it.
        """


class Matching(Protocol):
    """Assigns predictions to truths (group `matching`)."""

    def assign(self, cost: NDArray[np.float64]) -> NDArray[np.int64]:
        """Pairs (K, 2) of (row, column) of least total cost."""


class InstanceExtractor(Protocol):
    """From volumes to instances (group `postprocessing`)."""

    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        """Instances (X, Y, Z) int32 and object centres (N, 3) metres of one scene.

        Args:
            tsdf: (X, Y, Z) metres.
            votes: (3, X, Y, Z), need not be normalised.
            grid: the voxel grid of both.
        """


class Reconstructor(Protocol):
    """A method that evaluation compares: from partial views to complete scenes."""

    def reconstruct(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> Sequence[tuple[Tensor, Tensor]]:
        """`samples` pairs of TSDF (B, X, Y, Z) metres and instances (B, X, Y, Z) int32."""


class RunningHeights(Protocol):
    """A height map that grows frame by frame."""

    def add(self, frame: Frame) -> None:
        """Fuses depth and colour of a frame, whose camera's pose is in the world frame."""

    def height_map(self) -> HeightMap:
        """The map of all frames so far."""


class HeightMapping(Protocol):
    """Fuses frames into height maps (group `mapping`, options `height_*`)."""

    grid: HeightGrid

    def begin(self, previous: HeightMap | None = None) -> RunningHeights:
        """An empty map, or one that goes on from an earlier one."""


class RunningLabels(Protocol):
    """Class probabilities of vertices that sharpen frame by frame."""

    def add(
        self, probabilities: NDArray[np.float32], frame: Frame, heights: HeightMap | None
    ) -> None:
        """Fuses what a frame's pixels are, (C, H, W) that sum to 1; depth 0 says nothing.

        Args:
            probabilities: (C, H, W) float32.
            frame: that they are of.
            heights: a recent map; None only for fusion that reads the frame alone.
        """

    def probabilities(self) -> NDArray[np.float32]:
        """(C, V, V), uniform where nothing was said."""


class SemanticMapping(Protocol):
    """Fuses labelled views into a height map (group `mapping`).

    An attribute `reads_map = True` says that it reads the map so far, not the frame alone.
    """

    def begin(
        self, grid: HeightGrid, classes: int, previous: NDArray[np.float32] | None = None
    ) -> RunningLabels:
        """Uniform probabilities, or those (C, V, V) of an earlier map."""


class LabelSource(Protocol):
    """Says what each pixel of a frame is: a network, files of masks, the truth, a callable."""

    classes: Sequence[str]

    def label(self, frame: Frame) -> NDArray[np.float32]:
        """Probabilities (C, H, W), summing to 1 over the classes."""


class MapLabelSource(Protocol):
    """Says what each vertex of a height map is."""

    classes: Sequence[str]

    def label_map(self, height_map: HeightMap) -> NDArray[np.float32]:
        """Probabilities (C, V, V), summing to 1; uniform where the map is unseen."""


class RunningLabelling(Protocol):
    """A labelled height map that grows frame by frame."""

    def add(self, frame: Frame) -> None:
        """Takes in the next frame."""

    def height_map(self) -> HeightMap:
        """The map so far with probabilities, labels, sources and classes."""


class Labelling(Protocol):
    """A strategy of labelling a scene from many views (group `labelling`)."""

    def begin(self, previous: HeightMap | None = None) -> RunningLabelling:
        """Starts a scene, or goes on with a saved one."""


class FrameSource(Protocol):
    """Scenes with RGB-D views and, where known, ground truth (group `dataset`, `tabletop*`)."""

    classes: Sequence[str]

    def __len__(self) -> int:
        """Number of scenes."""

    def frames(self, scene: int, count: int, start: int = 0) -> Iterator[Frame]:
        """Views number start to start + count - 1 of a scene; view i never changes."""

    def truth(self, scene: int) -> HeightMap:
        """Orthographic heights, colour and labels of the scene."""


class Task(Protocol):
    """One verb of the command line (group `run`)."""

    def run(self) -> Mapping[str, Any]:
        """Does the work; returns flat figures by name."""
