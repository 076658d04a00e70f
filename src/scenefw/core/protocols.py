"""One small protocol per component group; tensors are batched, channels first, on one device.

Protocols of labelling are in `core.labelling_protocols`, of training in `core.training_protocols`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy as np
    import torch
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.batches import CameraBatch, Completion, PartialTSDF, SceneVolumes, SeenSurface
    from scenefw.core.evidence import Evidence, FittedSuperquadric
    from scenefw.core.floors import Floor
    from scenefw.core.measures import Measure
    from scenefw.core.types import (
        Camera,
        Float32,
        Float64,
        Frame,
        GridSpec,
        Int32,
        Pose,
        Scene,
        SceneEstimate,
        SceneObject,
        Shape,
        TriangleMesh,
    )

Item = TypeVar("Item")
Found = TypeVar("Found")


class ShapeSource(Protocol):
    """Shapes to make scenes from (group `shape`)."""

    def sample(self, rng: np.random.Generator, split: str) -> Shape:
        """One random shape for a scene of a part of the data: train, val, test or final."""


class Engine(Protocol):
    """A rigid-body simulator holding one scene on the floor z = 0 (group `engine`)."""

    def reset(self) -> None:
        """Empties the world."""

    def add(self, item: SceneObject) -> int:
        """Adds an object and returns its handle."""

    def remove(self, handle: int) -> None:
        """Removes an object."""

    def overlaps(self, handle: int) -> bool:
        """Whether the object touches another object or the floor where it is now."""

    def settle(self, max_steps: int) -> bool:
        """Simulates until everything rests, at most `max_steps` steps; returns whether it rests."""

    def simulate(self, steps: int) -> None:
        """Simulates exactly `steps` steps."""

    def pose(self, handle: int) -> Pose:
        """Current pose of the object."""


class SceneSource(Protocol):
    """Makes scenes (group `scene`).

    Scenes that are done are kept under a name made of the public attributes of the source and of
    its parts (`core.made_of`), so all that changes a scene is in one of these. Shapes are
    superquadrics alone or `SolidMesh`es alone, since files hold nothing else (`scenes.storage`).
    """

    def generate(self, index: int, seed: int) -> Scene | None:
        """Attempt number `index` of the data set `seed`; None if the attempt failed."""


class Workers(Protocol):
    """Where independent pieces of work are done (group `parallel`)."""

    def each(
        self, work: Callable[[Item], Found], items: Sequence[Item], *, ordered: bool = True
    ) -> Iterator[Found]:
        """Results as they are done, in the order of the items if `ordered`.

        `work`, items and results travel between processes.
        """


class SceneBatch(Protocol):
    """B scenes on one device, to make volumes of: of superquadrics or of meshes."""

    grid: GridSpec

    @property
    def volumes(self) -> SceneVolumes:
        """Their exact distances, votes and instances, computed once, when first read."""

    def depth(self, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of the shapes themselves, without floor; 0 = nothing hit."""

    def chosen(self, rows: Tensor) -> SceneBatch:
        """Some of the scenes, by their numbers (N,); volumes aren't computed again."""


class Representation(Protocol):
    """A volume that describes a scene and that networks predict (group `representation`)."""

    channels: int

    def of_scenes(self, scenes: SceneBatch) -> Tensor:
        """The volumes of B scenes, (B, channels, X, Y, Z), in its own units, on their device."""

    def to_network(self, volume: Tensor, grid: GridSpec) -> Tensor:
        """A volume of `of_scenes` in the network's units, float32: the target of losses."""

    def from_network(self, output: Tensor, grid: GridSpec) -> Tensor:
        """A network's output (..., channels, X, Y, Z) in the units of `of_scenes`, float32."""


class Renderer(Protocol):
    """Depth images of TSDF grids (group `renderer`)."""

    def render(self, tsdf: Tensor, grid: GridSpec, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of TSDFs (B, 1, X, Y, Z) in metres; 0 = nothing hit."""

    def render_scenes(self, scenes: SceneBatch, cameras: CameraBatch) -> Tensor:
        """Z-depth (B, H, W) in metres of known scenes, one camera each; 0 = nothing hit."""


class SurfaceRenderer(Renderer, Protocol):
    """A renderer that also says whose surface each pixel shows."""

    def render_surface(
        self, tsdf: Tensor, instances: Tensor, grid: GridSpec, cameras: CameraBatch
    ) -> SeenSurface:
        """Depth, normals and labels of TSDFs (B, 1, X, Y, Z) m and instances (B, X, Y, Z)."""


class FloorFinding(Protocol):
    """Finds what the objects of a depth image stand on (group `floor`)."""

    def find(self, frame: Frame) -> Floor:
        """The floor of a frame, in its camera's coordinates.

        Raises:
            InputError: the image shows none.
        """


class MappingMethod(Protocol):
    """Fuses depth images into a partial TSDF (group `mapping`)."""

    def fuse(self, depth: Tensor, grid: GridSpec, cameras: CameraBatch) -> PartialTSDF:
        """Partial TSDF of each of B depth images (B, H, W), metres, 0 = no measurement."""


class Noise(Protocol):
    """Adds sensor noise to depth images (group `noise`).

    Its amounts are public attributes: they are told with weights that were trained on it, and name
    what is kept of noisy images (`core.made_of`).
    """

    def apply(self, depth: Tensor, cameras: CameraBatch, seeds: Tensor) -> Tensor:
        """Noisy copy of z-depth (B, H, W) in metres; 0 stays 0.

        Args:
            depth: (B, H, W) metres.
            cameras: one per image.
            seeds: (B,) int64, 0 or more, on the device of the depth: each image's noise
                depends only on its own seed, not on the rest of the batch.
        """


@runtime_checkable
class PoseNoise(Noise, Protocol):
    """Noise that moves a frame's camera away from its true pose (group `noise`)."""

    DRAWS: int
    """Number of draws from [0, 1) per camera."""

    def move(self, camera: Camera, generator: torch.Generator) -> Camera:
        """The camera at a disturbed pose, drawn from a generator on the CPU."""

    def moves(self, draws: Float64) -> Float64:
        """Disturbed poses (B, 4, 4) in the frames of their cameras, from draws (B, `DRAWS`)."""


class Matching(Protocol):
    """Assigns predictions to truths (group `matching`)."""

    def assign(self, cost: NDArray[np.float64]) -> NDArray[np.int64]:
        """Pairs (K, 2) of (row, column) with the lowest total cost."""


class InstanceExtractor(Protocol):
    """From volumes to instances (group `postprocessing`)."""

    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        """Instances (X, Y, Z) int32, 1..N, and object centres (N, 3) metres, on the TSDF's device.

        Where scenes are predicted, pieces of an instance that don't touch become objects each.

        Args:
            tsdf: (X, Y, Z) metres.
            votes: (3, X, Y, Z), need not be normalised.
            grid: the voxel grid of both.
        """


class Reconstructor(Protocol):
    """A method that evaluation compares: from partial views to complete scenes."""

    @property
    def grid(self) -> GridSpec | None:
        """The grid of its volumes; None if it takes any."""

    def complete(
        self, partial: PartialTSDF, grid: GridSpec, samples: int, generator: torch.Generator
    ) -> Sequence[Completion]:
        """Complete scenes of B partial views, `samples` times, or once if all are the same."""


class ShapeFit(Protocol):
    """A method that explains what views say about objects by superquadrics (group `fit`)."""

    def fit(self, evidence: Sequence[Evidence]) -> list[FittedSuperquadric]:
        """The best one for each object, as if there were no others; each has four points or more.

        The result depends on the evidence about this object alone.
        """

    def separate(
        self, evidence: Sequence[Evidence], fits: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """The best ones such that none penetrates another."""

    def together(
        self, evidence: Sequence[Evidence], start: Sequence[FittedSuperquadric]
    ) -> list[FittedSuperquadric]:
        """Superquadrics near those, fitted again such that none penetrates another."""

    def draws(
        self,
        evidence: Sequence[Evidence],
        fits: Sequence[FittedSuperquadric],
        count: int,
        generator: np.random.Generator,
    ) -> list[list[FittedSuperquadric]]:
        """`count` lists of others that the evidence allows, none of which penetrates another."""


class Settling(Protocol):
    """Lets predicted objects come to rest (group `settling`)."""

    def settle(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """Scenes of one image after that, in any order; `details["settled"]` is a `Settled`."""


class HypothesisRanking(Protocol):
    """Orders hypotheses (group `ranking`)."""

    def rank(self, scenes: Sequence[SceneEstimate]) -> list[SceneEstimate]:
        """Scenes of one image, the most typical first, in a better order; details say why."""


class SceneFormat(Protocol):
    """A file format of scene estimates (group `export`)."""

    @property
    def suffix(self) -> str:
        """Of its files, with the dot."""

    def write(
        self, path: Path, estimate: SceneEstimate, colours: Sequence[Sequence[float]]
    ) -> None:
        """Writes a scene, and what the file refers to into a folder of its name beside it.

        Args:
            path: the file, replaced as a whole.
            estimate: the scene, world frame, metres.
            colours: red, green, blue in [0, 1] of each object.

        Raises:
            StorageError: a file can't be written.
        """


class CollisionShapes(Protocol):
    """Says which convex shapes a simulator takes for an object (group `collision`)."""

    def parts(self, mesh: TriangleMesh) -> Sequence[TriangleMesh]:
        """Closed convex meshes that stand for a closed mesh."""


class SceneOverTime(Protocol):
    """A scene after an image of several."""

    @property
    def scenes(self) -> Sequence[SceneEstimate]:
        """Its hypotheses; an object has the same id in all images."""

    @property
    def partial(self) -> Float32:
        """(X, Y, Z) partial TSDF of the last image that was looked at anew (m)."""

    @property
    def warnings(self) -> Sequence[str]:
        """What looks wrong about the image."""


class ObjectTracking(Protocol):
    """Follows objects over the images of a scene (group `tracking`)."""

    def track(
        self,
        frame: Frame,
        mask: NDArray[np.bool_] | Int32 | None = None,
        T_base_camera: Float64 | None = None,  # noqa: N803
    ) -> SceneOverTime:
        """The scene after the next image; one that is refused changes nothing.

        Args:
            frame: of the same camera as those before.
            mask: (H, W), where objects are; None: anywhere.
            T_base_camera: 4x4 pose of the camera in a base that stands still; None: it stands.

        Raises:
            InputError: the image is unusable, or doesn't fit those before.
        """


class Result(Protocol):
    """What an evaluation found."""

    @property
    def figures(self) -> Mapping[str, float]:
        """All figures by name, as `metrics.json` has them."""

    @property
    def measures(self) -> Mapping[str, Measure]:
        """How figures are printed, by name; a figure without a measure is printed as is."""


class Track(Protocol):
    """Wraps a loop, e.g. in a progress bar."""

    def __call__(self, items: Sequence[Item], what: str, /) -> Iterable[Item]:
        """The items in order; `what` names them in a word or two."""


class Evaluation(Protocol):
    """Scores methods, or gathers scores (group `evaluation`)."""

    def run(self, track: Track = ...) -> Result:
        """Runs the evaluation; `track` wraps its main loop."""


class Task(Protocol):
    """One verb of the command line (group `run`)."""

    def run(self) -> Mapping[str, Any]:
        """Does the work; returns flat figures by name."""
