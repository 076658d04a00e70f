"""Predicted instances against hand-labelled real depth images (overlap, boundary, object count)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, map_coordinates

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.measures import Measure
from scenefw.core.protocols import Track
from scenefw.core.types import Float64, Frame, Int32, SceneEstimate
from scenefw.data.readers import find_images, read_frame, read_labels
from scenefw.evaluation.stacks.depth_components import DepthComponents
from scenefw.evaluation.stacks.measures import REAL_IMAGES, REFERENCE
from scenefw.metrics.masks import MaskScores, mask_scores
from scenefw.perception.points import world_points


class Estimator(Protocol):
    """From a depth image to a complete scene in the frame of its floor."""

    def estimate(self, frame: Frame) -> SceneEstimate:
        """The scene; raises an InputError where the image can't be used."""


@dataclass(frozen=True)
class ImageResult:
    """One labelled image.

    Args:
        name: of the image.
        scores: of the method.
        reference: scores of the segmentation without learning.
        labels: (H, W) int16 of `true` (-1 = unknown), `method` and `reference`.
        colour: (H, W, 3) uint8 or None.
    """

    name: str
    scores: MaskScores
    reference: MaskScores
    labels: Mapping[str, NDArray[np.int16]]
    colour: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class Failure:
    """A labelled image that could not be reconstructed.

    Args:
        name: of the image.
        reason: one line.
        objects: how many are labelled; None where the file can't be read at all.
    """

    name: str
    reason: str
    objects: int | None

    @property
    def scores(self) -> MaskScores:
        """Nothing is found, so all shares are 0 and every labelled object is missed."""
        return MaskScores(0, 0, 0, 0, 0, 0, 0, predicted=0, true=self.objects or 0)


@dataclass(frozen=True)
class RealMaskResult:
    """Results of all labelled images, and those that could not be reconstructed.

    The latter count as well, for both methods, as the reference stands on the same floor.
    """

    images: tuple[ImageResult, ...]
    failures: tuple[Failure, ...] = ()

    @property
    def number(self) -> int:
        """Labelled images, failed ones included."""
        return len(self.images) + len(self.failures)

    def scores(self, which: Literal["scores", "reference"] = "scores") -> list[MaskScores]:
        """Of every image, failed ones last."""
        return [getattr(i, which) for i in self.images] + [f.scores for f in self.failures]

    @property
    def figures(self) -> dict[str, float]:
        """Means over images by name; the reference's have the prefix `reference/`."""
        ours, theirs = self._means("scores"), self._means("reference")
        counts = {"images": float(self.number), "failures": float(len(self.failures))}
        return ours | {f"{REFERENCE}/{name}": value for name, value in theirs.items()} | counts

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return REAL_IMAGES

    def _means(self, which: Literal["scores", "reference"]) -> dict[str, float]:
        means = {name: _mean(self.scores(which), name) for name in SCORES}
        known = [getattr(i, which) for i in self.images]
        known += [f.scores for f in self.failures if f.objects is not None]
        return {**means, COUNT_ERROR: _mean(known, COUNT_ERROR)}


COUNT_ERROR = "count_error"
SCORES = [f.name for f in fields(MaskScores) if f.name not in {"predicted", "true"}]
SCORES.append(COUNT_ERROR)


class RealMasks:
    """Scores a method on labelled depth images, beside a segmentation without learning.

    A pixel takes the instance of the predicted volume at its own 3D point, so that the borders come
    from the image and not from the silhouettes of voxels. A labelled image that no scene can be
    made of scores 0, and all its objects are missed.

    Args:
        input: a labelled depth image or a folder of them; those without labels are left out.
        method: makes the scenes.
        reference: segments the same images without learning.
        margin: points up to this height above the floor belong to no object (m).
        reach: how far outside a predicted object a seen point may lie and still be its (voxels).
        tolerance: see `metrics.masks.mask_scores`.

    Raises:
        ConfigError: no input is given.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        method: Estimator,
        reference: DepthComponents,
        margin: float = 0.005,
        reach: float = 2.0,
        tolerance: float = 0.003,
    ) -> None:
        if input is None:
            raise ConfigError(
                "evaluation=osd needs input=FOLDER of labelled depth images (.npz with `label`)"
            )
        self.input = Path(input)
        self.method = method
        self.reference = reference
        self.margin = margin
        self.reach = reach
        self.tolerance = tolerance

    def run(self, track: Track = lambda paths, _: paths) -> RealMaskResult:
        """Scores every labelled image; `track` wraps the loop in a progress bar.

        Raises:
            InputError: no image has labels, or no labelled image could be used.
        """
        paths = find_images(self.input)
        images: list[ImageResult] = []
        failures: list[Failure] = []
        for path in track(paths, "labelled images"):
            try:
                frame = read_frame(path)
                if frame.labels is not None:
                    images.append(self._score(frame, frame.labels))
            except InputError as error:
                failures += _failure(path, error)
        if not images and failures:
            raise InputError(f"no labelled image could be used; the first: {failures[0].reason}")
        if not images:
            raise InputError(
                f"none of the {len(paths)} images in {self.input} has labels; this needs a "
                "`label` array beside the depth (input=FOLDER of labelled .npz files)"
            )
        return RealMaskResult(tuple(images), tuple(failures))

    def _score(self, frame: Frame, true: Int32) -> ImageResult:
        estimate = self.method.estimate(frame)
        ours = seen_instances(estimate, self.margin, self.reach)
        plain = self.reference.segment(estimate.frame)
        labels = {"true": true, "method": ours, "reference": plain}
        return ImageResult(
            frame.name,
            mask_scores(ours, true, self.tolerance),
            mask_scores(plain, true, self.tolerance),
            {name: image.astype(np.int16) for name, image in labels.items()},
            frame.colour,
        )


def _failure(path: Path, error: InputError) -> list[Failure]:
    """The failed image, with its number of objects; empty if it has no labels."""
    try:
        true = read_labels(path)
    except InputError:  # the same damage, or more: it may well have labels
        return [Failure(path.stem, str(error), None)]
    if true is None:
        return []
    return [Failure(path.stem, str(error), len(np.unique(true[true > 0])))]


def seen_instances(estimate: SceneEstimate, margin: float = 0.005, reach: float = 2.0) -> Int32:
    """Instance labels (H, W) of the depth pixels of the estimate's own frame, 0 = no object.

    Every pixel is looked up at its 3D point: the instance whose signed distance there is least, if
    that is below `reach` voxels. Points within `margin` (m) of the floor or below it are floor.
    """
    points = world_points(estimate.frame)
    voxels = estimate.grid.to_voxels(points)
    inside = np.all((voxels > -0.5) & (voxels < estimate.grid.resolution - 0.5), axis=-1)
    chosen = inside & (points[..., 2] > margin)
    labels = np.zeros(chosen.shape, np.int32)
    labels[chosen] = _nearest_instance(estimate.instances, voxels[chosen], reach)
    return labels


def _nearest_instance(instances: Int32, voxels: Float64, reach: float) -> Int32:
    """Instance (K,) of least signed distance at voxel coordinates (K, 3), 0 beyond reach."""
    nearest, label = np.full(len(voxels), reach), np.zeros(len(voxels), np.int32)
    for i in np.unique(instances[instances > 0]):
        inside = instances == i
        field = distance_transform_edt(~inside) - distance_transform_edt(inside)
        distance = map_coordinates(field, voxels.T, order=1, mode="nearest")
        closer = distance < nearest
        nearest[closer], label[closer] = distance[closer], i
    return label


def _mean(scores: Sequence[MaskScores], name: str) -> float:
    return float(np.mean([getattr(score, name) for score in scores]))
