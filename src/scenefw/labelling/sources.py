"""Sources of labels: networks, ground truth, mask files, any function."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from scenefw.core.errors import CheckpointError, ConfigError, InputError
from scenefw.core.files import unreadable
from scenefw.core.height_maps import HeightMap
from scenefw.core.rng import generator, number_of
from scenefw.core.settings import SHARE
from scenefw.core.training_protocols import SegmentationModel, Trained
from scenefw.core.types import Frame
from scenefw.data.files.pictures import DAMAGED_PICTURE
from scenefw.labelling.network_inputs import DEPTH, distance_image, image_tensor
from scenefw.labelling.sliding_window import SlidingWindow

Probabilities = NDArray[np.float32]
Labels = NDArray[np.integer]


class NetworkLabels:
    """Labels views with a network that was trained on views.

    Args:
        checkpoint: a loaded checkpoint.
        classes: names by class id to expect; None takes those of the checkpoint.
        device: where the network runs.

    Raises:
        CheckpointError: the checkpoint has other classes, or was trained on maps.
    """

    def __init__(
        self,
        checkpoint: Trained[SegmentationModel],
        classes: Sequence[str] | None = None,
        device: str = "cpu",
    ) -> None:
        self.classes = agreed_classes(checkpoint, classes, "views")
        self.geometry = str(checkpoint.metadata.get("geometry", DEPTH))
        self.device = torch.device(device)
        self.model = _ready(checkpoint.model, self.device)

    @torch.inference_mode()
    def label(self, frame: Frame) -> Probabilities:
        """Probabilities (C, H, W) of the classes.

        Raises:
            InputError: the frame has no colour.
        """
        if frame.colour is None:
            raise InputError(f"frame {frame.name} has no colour image, which the network needs")
        distance = torch.from_numpy(distance_image(frame, self.geometry))[None, None]
        colour = image_tensor(frame.colour)[None]
        scores = self.model(colour.to(self.device), distance.to(self.device))
        return scores[0].float().softmax(dim=0).cpu().numpy()


class NetworkMapLabels:
    """Labels whole height maps with a network that was trained on crops of maps.

    A map is sampled at the spacing of those that the network learned from, where its checkpoint
    says it, so that things are as many pixels large as there.

    Args:
        checkpoint: a loaded checkpoint.
        window: cuts the map into windows; None takes as large ones as free memory holds.
        classes: names by class id to expect; None takes those of the checkpoint.
        device: where the network runs.

    Raises:
        CheckpointError: the checkpoint has other classes, or was trained on views.
    """

    def __init__(
        self,
        checkpoint: Trained[SegmentationModel],
        window: SlidingWindow | None = None,
        classes: Sequence[str] | None = None,
        device: str = "cpu",
    ) -> None:
        self.classes = agreed_classes(checkpoint, classes, "maps")
        self.window = window or SlidingWindow()
        self.spacing: float | None = checkpoint.metadata.get("spacing")
        self.model = _ready(checkpoint.model, torch.device(device))

    def label_map(self, height_map: HeightMap) -> Probabilities:
        """Probabilities (C, V, V) of the classes, uniform where the map is unseen."""
        grid = height_map.grid
        count = grid.vertices
        if self.spacing is not None:
            count = max(2, round(grid.extent / self.spacing) + 1)
        there, back = _nearest(grid.vertices, count), _nearest(count, grid.vertices)
        colour = image_tensor(height_map.colour[there][:, there])
        distance = torch.from_numpy(height_map.heights[there][:, there])[None]
        probabilities: Probabilities = self.window.probabilities(
            self.model, colour, distance
        ).numpy()[:, back][:, :, back]
        probabilities[:, ~height_map.seen] = 1 / len(self.classes)
        return probabilities


def _nearest(length: int, count: int) -> NDArray[np.intp]:
    """Of `length` vertices along a side those next to `count` evenly spaced ones."""
    return np.rint(np.linspace(0, length - 1, count)).astype(np.intp)


class TrueLabels:
    """The true labels of frames, with a given share of wrong ones: for studies and tests.

    Args:
        classes: names by class id.
        error_rate: share of pixels that get another class, any with the same chance.
        confidence: probability of the class given; the others share the rest.
        seed: of the errors, which for a frame depend on (seed, its name) alone.
    """

    def __init__(
        self,
        classes: Sequence[str],
        error_rate: float,
        confidence: float,
        seed: int = 0,
    ) -> None:
        SHARE.require(error_rate=error_rate)
        _require_confidence(confidence, classes)
        self.classes = tuple(classes)
        self.error_rate, self.confidence, self.seed = error_rate, confidence, seed

    def label(self, frame: Frame) -> Probabilities:
        """Probabilities (C, H, W); uniform where the truth is unknown.

        Raises:
            InputError: the frame has no labels.
        """
        if frame.labels is None:
            raise InputError(f"frame {frame.name} has no true labels; give another label_source")
        labels, count = frame.labels, len(self.classes)
        if self.error_rate:
            rng = generator(self.seed, number_of(frame.name))
            wrong = (rng.random(labels.shape) < self.error_rate) & (labels >= 0)
            wrong_labels = (labels + rng.integers(1, count, labels.shape)) % count
            labels = np.where(wrong, wrong_labels, labels)
        return one_hot(labels, count, self.confidence, frame.name)


class MaskFiles:
    """Labels from image files of class ids, one per frame with the same name.

    Args:
        folder: holds `<name of the frame>.png`, 8 or 16 bits of one channel; 255 = unknown. None =
            `masks` in that of the recording.
        classes: names by class id.
        confidence: probability of the class that a file gives.
        recording: folder of the frames.

    Raises:
        ConfigError: there is no folder, or the confidence is not a probability.
    """

    def __init__(
        self,
        folder: str | Path | None,
        classes: Sequence[str],
        confidence: float = 0.95,
        recording: str | Path | None = None,
    ) -> None:
        _require_confidence(confidence, classes)
        if folder is None and recording is None:
            raise ConfigError("labels from masks need label_source.folder=FOLDER of the images")
        folder = Path(recording or "") / "masks" if folder is None else folder
        self.folder, self.classes, self.confidence = Path(folder), tuple(classes), confidence

    def label(self, frame: Frame) -> Probabilities:
        """Probabilities (C, H, W); uniform where the file says unknown.

        Raises:
            InputError: there is no such file, or it doesn't fit the frame or the classes.
        """
        path = self.folder / f"{frame.name}.png"
        labels = _read_mask(path)
        if labels.shape != frame.depth.shape:
            raise InputError(
                f"{path} is {labels.shape[::-1]} pixels, its frame {frame.depth.shape[::-1]}; "
                "give a mask with one channel and the size of the frame"
            )
        labels = labels if frame.undistort is None else frame.undistort(labels)
        labels = np.where(labels == 255, -1, labels.astype(np.int32))
        return one_hot(labels, len(self.classes), self.confidence, str(path))


def one_hot(labels: Labels, classes: int, confidence: float, name: str) -> Probabilities:
    """Probabilities (C, H, W) of ids (H, W): `confidence` for the id, uniform where below 0.

    Raises:
        InputError: there is an id that no class has.
    """
    if labels.max(initial=0) >= classes:
        raise InputError(
            f"{name} has the class id {labels.max()}, but there are {classes} classes; give the "
            "classes that it was labelled with"
        )
    result = np.full((classes, *labels.shape), (1 - confidence) / (classes - 1), np.float32)
    np.put_along_axis(result, np.maximum(labels, 0)[None].astype(np.int64), confidence, axis=0)
    result[:, labels < 0] = 1 / classes
    return result


def _require_confidence(confidence: float, classes: Sequence[str]) -> None:
    """Raises a ConfigError unless the class of an id is more probable than the others."""
    minimum = 1 / max(len(classes), 1)
    if not minimum < confidence <= 1:
        raise ConfigError(
            f"confidence = {confidence}, the probability of the given one of "
            f"{len(classes)} classes; expected more than {minimum:.3g} and at most 1"
        )


def agreed_classes(
    checkpoint: Trained[SegmentationModel], classes: Sequence[str] | None, kind: str
) -> tuple[str, ...]:
    """The classes of a checkpoint, which must be those expected.

    Raises:
        CheckpointError: they differ, or it was trained on something else than `kind`.
    """
    trained_classes = tuple(checkpoint.metadata.get("classes", ()))
    trained_on = checkpoint.metadata.get("input", kind)
    if trained_on != kind:
        raise CheckpointError(
            f"the network was trained on {trained_on}, expected one trained on {kind}; give the "
            "other checkpoint"
        )
    if classes is not None and tuple(classes) != trained_classes:
        raise CheckpointError(
            f"the network labels {', '.join(trained_classes)}, expected {', '.join(classes)}; give "
            "a checkpoint that was trained on these classes"
        )
    return trained_classes


def _ready(model: nn.Module, device: torch.device) -> nn.Module:
    """The network, prepared to run fast."""
    return model.to(device, memory_format=torch.channels_last).eval()


def _read_mask(path: Path) -> Labels:
    from PIL import Image

    try:
        with Image.open(path) as image:
            return np.asarray(image)
    except DAMAGED_PICTURE as error:
        raise InputError(
            f"cannot read the mask {path} ({unreadable(error)}); there must be one PNG per frame "
            "with the same name"
        ) from error
