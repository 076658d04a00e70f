"""Protocols of training: data, networks, losses, metrics and loggers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import torch
    from torch import Tensor

    from scenefw.core.batches import (
        IndexBatch,
        SceneParameters,
        SegmentationBatch,
        SegmentationSetup,
        ShapeInstanceBatch,
        ShapeInstancePrediction,
        ShapeInstanceSetup,
    )
    from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction
    from scenefw.core.protocols import Representation
    from scenefw.core.rng import Streams
    from scenefw.core.set_flows import SetFlowBatch, SetFlowPrediction
    from scenefw.core.types import Float64, GridSpec


Model = TypeVar("Model")


class TrainingData(Protocol):
    """A Lightning data module that makes batches where the network trains (group `dataset`).

    Its loaders (`train_dataloader`, `val_dataloader`) give an `IndexBatch` by its number.
    """

    batch_size: int
    grid: GridSpec | None

    def facts(self) -> Mapping[str, Any]:
        """Facts about the training data, as plain data for the checkpoint's metadata."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> Any:
        """The samples of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> Any:
        """The same samples in every epoch."""


class Augmentation(Protocol):
    """Random motions of training scenes (group `augmentation`)."""

    def draw(self, streams: Streams) -> Float64:
        """Numbers (B, K) that say how each of B scenes moves, from one stream of its own each."""

    def apply(self, parameters: SceneParameters, motions: Tensor) -> SceneParameters:
        """B scenes, each moved as its row of `draw` says, which lies on their device as float32."""


class ShapeInstanceData(TrainingData, Protocol):
    """Partial views of scenes with their complete volumes (group `dataset`, options `stacks*`)."""

    grid: GridSpec
    representations: Mapping[str, Representation]

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ShapeInstanceBatch:
        """Views and volumes of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ShapeInstanceBatch:
        """The same views in every epoch, with their volumes in both units."""


class ObjectSetData(TrainingData, Protocol):
    """Partial views of scenes with their objects (group `dataset`, option `object_sets`)."""

    grid: GridSpec
    most: int
    """The largest number of objects in a scene."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> ObjectSetBatch:
        """Views and objects of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> ObjectSetBatch:
        """The same views in every epoch."""


class SetFlowData(TrainingData, Protocol):
    """What views show of each superquadric of a scene (group `dataset`, option `set_flow`)."""

    most: int
    """The largest number of objects in a scene."""

    def training_batch(self, batch: IndexBatch, device: torch.device) -> SetFlowBatch:
        """Views and objects of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> SetFlowBatch:
        """The same views in every epoch."""


class SegmentationTrainingData(TrainingData, Protocol):
    """Labelled views or crops of maps (group `dataset`, options `tabletop*`)."""

    classes: Sequence[str]

    def training_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The samples of an epoch, each a function of only (seed, epoch, index)."""

    def validation_batch(self, batch: IndexBatch, device: torch.device) -> SegmentationBatch:
        """The same samples in every epoch."""


class Loss(Protocol):
    """One named term of a training's loss, and its weight in the sum."""

    weight: float
    needs_draws: bool
    """Whether it compares samples of two drawn codes; if so, left out until codes are drawn."""

    def check(self, setup: Any) -> None:
        """Raises a ConfigError before the work if it doesn't fit the training."""

    def __call__(self, prediction: Any, batch: Any) -> Tensor:
        """A scalar."""


class ShapeInstanceLoss(Loss, Protocol):
    """A term of the loss of shape-and-instance networks (group `loss`)."""

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError before the work if it doesn't fit these volumes."""

    def __call__(self, prediction: ShapeInstancePrediction, batch: ShapeInstanceBatch) -> Tensor:
        """A scalar."""


class SegmentationLoss(Loss, Protocol):
    """A term of the loss of labelling networks (group `loss`)."""

    def check(self, setup: SegmentationSetup) -> None:
        """Raises a ConfigError before the work if it doesn't fit these classes."""

    def __call__(self, prediction: Tensor, batch: SegmentationBatch) -> Tensor:
        """A scalar from scores (B, classes, H, W)."""


class Network(Protocol):
    """A `torch.nn.Module` that can be rebuilt from a file of weights (group `model`)."""

    recipe: Mapping[str, Any]
    """Its class as `_target_`, and its arguments as plain data."""
    training_only: Sequence[str]
    """Children used only in training; weights are stored without them, and they load as None."""


class Trained(Protocol[Model]):
    """A loaded checkpoint of a network of some kind (`learning.checkpoint.load_checkpoint`)."""

    model: Model
    recipe: Mapping[str, Any]
    metadata: Mapping[str, Any]


class TrainedOnGrid(Trained[Model], Protocol[Model]):
    """The same of a network that sees volumes, or predicts some."""

    grid: GridSpec


class ShapeInstanceModel(Network, Protocol):
    """A network from a partial view to complete volumes (group `model`)."""

    latent_size: int
    """Length of the latent code, for what the view leaves open; 0: it has none."""
    outputs: Mapping[str, int]
    """Channels of each predicted volume, by name of the representation."""

    def redraws(self, count: int) -> int:
        """How many views of a training batch of `count` get two codes from the prior."""

    def forward(
        self,
        batch: ShapeInstanceBatch,
        generator: torch.Generator | None = None,
        *,
        draw: bool = True,
    ) -> ShapeInstancePrediction:
        """Training pass, which may see the full scene.

        Args:
            batch: views and complete scenes.
            generator: of codes, on the CPU; None: no code is random.
            draw: whether codes may come from the prior; False before `learning.draw_from`.
        """

    def __call__(
        self,
        batch: ShapeInstanceBatch,
        generator: torch.Generator | None = None,
        *,
        draw: bool = True,
    ) -> ShapeInstancePrediction:
        """Calls `forward`, as torch does."""

    def predict(self, condition: Tensor, latent: Tensor | None = None) -> ShapeInstancePrediction:
        """Test pass from conditions (B, 2, X, Y, Z), distances within [-1, 1].

        Args:
            condition: as in `ShapeInstanceBatch`.
            latent: (S B, latent_size) codes, sample after sample; None means the zero code.
        """


class ObjectSetModel(Network, Protocol):
    """A network from a scene or a view to a set of objects (group `model`, options `set_*`)."""

    resolution: int
    """Voxels per side of what it sees and predicts."""
    slots: int
    """Objects that it predicts."""
    sees: str
    """occupancy: the complete scene; view: the partial TSDF; both."""
    gives: set[str]
    """What it predicts beside shapes, as in `ObjectSetSetup`."""
    latent_shape: tuple[int, ...]
    """Of the feature volume that can be drawn from N(0, I) for a view; (): it draws none."""

    def forward(
        self, batch: ObjectSetBatch, generator: torch.Generator | None = None
    ) -> ObjectSetPrediction:
        """Training pass.

        Args:
            batch: scenes and views.
            generator: of what is drawn, on the CPU; None: nothing is.
        """

    def __call__(
        self, batch: ObjectSetBatch, generator: torch.Generator | None = None
    ) -> ObjectSetPrediction:
        """Calls `forward`, as torch does."""


class DrawnSetModel(ObjectSetModel, Protocol):
    """One that draws sets for a view."""

    prior_sees_view: bool
    """Whether the view decides on what is likely; without, zeros are no typical draw."""

    def sample(self, condition: Tensor, latent: Tensor) -> ObjectSetPrediction:
        """Test pass.

        Args:
            condition: (B, 2, X, Y, Z), as in `ObjectSetBatch`.
            latent: (B, *latent_shape), drawn from N(0, I).
        """


class SetFlowModel(Network, Protocol):
    """A network that draws sets of superquadrics, given a view or none (group `model`)."""

    slots: int
    """Objects at most."""

    draws_hidden: bool
    """Whether objects of which nothing is seen are drawn too, and whole scenes without a view."""

    def forward(
        self, batch: SetFlowBatch, generator: torch.Generator | None = None
    ) -> SetFlowPrediction:
        """Training pass.

        Args:
            batch: views and objects.
            generator: of noise, on the CPU.
        """

    def __call__(
        self, batch: SetFlowBatch, generator: torch.Generator | None = None
    ) -> SetFlowPrediction:
        """Calls `forward`, as torch does."""

    def sample(
        self,
        batch: SetFlowBatch,
        count: int,
        generator: torch.Generator,
        steps: int = 20,
        spread: Sequence[float] | None = None,
    ) -> SetFlowBatch:
        """Draws `count` sets for one view.

        Rows of the batch are this view, each with other points of it. Draw k sees row k, and those
        after the last begin with the first again. The view's objects are what was fitted to it: a
        network may take their rotations as known. `spread` is the standard deviation of the noise
        of each draw, 1 as in training if None.
        """


class SegmentationModel(Network, Protocol):
    """A network from colour and distance to a label per pixel (group `model`).

    Maps larger than memory are labelled in windows (`labelling.sliding_window`), which `stride` and
    `margin` make equal to one pass over the whole map.
    """

    classes: int
    stride: int
    """An input shifted by a multiple of so many pixels gives the result shifted alike."""
    margin: int
    """Pixels further away than this don't change a pixel's scores; a multiple of `stride`."""

    def forward(self, colour: Tensor, distance: Tensor) -> Tensor:
        """Scores (B, classes, H, W) of (B, 3, H, W) in [0, 1] and (B, 1, H, W) m, NaN: missing."""

    def __call__(self, colour: Tensor, distance: Tensor) -> Tensor:
        """Calls `forward`, as torch does."""


class VolumeMetric(Protocol):
    """A validation figure of training on volumes (group `metric`)."""

    of_samples: bool
    """Whether it takes volumes of several drawn codes, (S, B, C, X, Y, Z), else of the zero code"""

    def check(self, setup: ShapeInstanceSetup) -> None:
        """Raises a ConfigError before the work if these volumes lack what it compares."""

    def __call__(
        self, predicted: Mapping[str, Tensor], true: Mapping[str, Tensor], grid: GridSpec
    ) -> Tensor:
        """A scalar from volumes (B, C, X, Y, Z) by name, in the units of their representations."""


class TrainingLogger(Protocol):
    """Keeps losses and scores of a training (group `logger`)."""

    def begin(self, folder: Path, step: int) -> None:
        """Starts in the training's folder, or resumes after `step` and drops later entries."""

    def log(self, step: int, epoch: int, seconds: float, values: Mapping[str, float]) -> None:
        """Adds values by name, such as `train/total` and `val/iou`."""

    def end(self) -> None:
        """Closes its files."""
