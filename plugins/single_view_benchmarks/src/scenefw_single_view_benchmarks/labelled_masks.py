"""Predicted instances against labelled depth images (overlap, boundary, object count)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError, InputError, LabelsError
from scenefw.core.measures import Measure
from scenefw.core.protocols import Track
from scenefw.core.types import Float64, Frame, Int32, SceneEstimate
from scenefw.data.files.readers import find_images, read_frame
from scenefw.perception.evidence.visible_instances import visible_instances
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.points import world_points
from scenefw.perception.segmentation.colour_edges import ColourEdges
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw_single_view_benchmarks.mask_measures import OF_MARGINS, REFERENCE, at_margin, of_images
from scenefw_single_view_benchmarks.mask_scores import MaskScores, mask_scores
from scenefw_single_view_benchmarks.seams import Seams, seam_scores

Source = Literal["scores", "reference"]
NO_SEAMS = Seams()
_FLOOR = 0.005  # m: what is lower shows no object


class Estimator(Protocol):
    """From a depth image to a complete scene in the frame of its floor."""

    def estimate(self, frame: Frame) -> SceneEstimate:
        """The scene; raises an InputError where the image can't be used."""


class TrueLabels(Protocol):
    """What a person said that images show."""

    @property
    def hint(self) -> str:
        """Where labels are looked for, for the message if there are none."""

    def of(self, image: Path) -> Int32 | None:
        """Labels (H, W): -1 unknown, 0 no object, 1..N; None if there are none of this image.

        Raises:
            LabelsError: they are unusable, though the image may be good.
            InputError: the image that holds them is damaged.
        """


@dataclass(frozen=True)
class Scored:
    """Masks of one image at one margin: their scores, and the borders between objects."""

    masks: MaskScores
    seams: Seams


@dataclass(frozen=True)
class ImageResult:
    """One labelled image.

    Args:
        name: of the image.
        scores: of the method.
        reference: scores of the segmentation without learning.
        labels: (H, W) int16 of `true` (-1 = unknown), `method` and `reference`.
        colour: (H, W, 3) uint8 or None.
        seams: of the method, borders between objects.
        reference_seams: of the segmentation without learning.
        margins: both methods, `scores` and `reference`, at other heights (m) that count as floor.
        beside: other methods, by name.
    """

    name: str
    scores: MaskScores
    reference: MaskScores
    labels: Mapping[str, NDArray[np.int16]]
    colour: NDArray[np.uint8] | None = None
    seams: Seams = NO_SEAMS
    reference_seams: Seams = NO_SEAMS
    margins: Mapping[float, Mapping[str, Scored]] = field(default_factory=dict)
    beside: Mapping[str, Scored] = field(default_factory=dict)


@dataclass(frozen=True)
class Failure:
    """A labelled image that could not be reconstructed.

    Args:
        name: of the image.
        reason: one line.
        objects: how many are labelled; None where the file can't be read at all.
        seams: pixels of the borders between them, none of them found.
    """

    name: str
    reason: str
    objects: int | None
    seams: Seams = NO_SEAMS

    @property
    def scores(self) -> MaskScores:
        """Nothing is found, so all shares are 0 and every labelled object is missed."""
        return MaskScores(0, 0, 0, 0, 0, 0, 0, predicted=0, true=self.objects or 0)


@dataclass(frozen=True)
class LabelledMaskResult:
    """Results of all labelled images, and those that could not be reconstructed.

    The latter count as well, for both methods, as the reference stands on the same floor.

    Args:
        images: scored ones.
        failures: others.
        about: the images, where their labels are from, and what was chosen on them, in sentences.
        published: whether published figures are of a data set that these images are part of.
    """

    images: tuple[ImageResult, ...]
    failures: tuple[Failure, ...] = ()
    about: str = ""
    published: bool = False

    @property
    def number(self) -> int:
        """Labelled images, failed ones included."""
        return len(self.images) + len(self.failures)

    def scores(self, source: Source = "scores") -> list[MaskScores]:
        """Of every image, failed ones last."""
        return [getattr(i, source) for i in self.images] + [f.scores for f in self.failures]

    def seams(self, source: Source = "scores") -> Seams:
        """Borders between objects, added up over all images, failed ones included."""
        name = "seams" if source == "scores" else "reference_seams"
        seams = [getattr(image, name) for image in self.images]
        return sum([*seams, *(f.seams for f in self.failures)], NO_SEAMS)

    @property
    def margins(self) -> tuple[float, ...]:
        """Heights (m) up to which points count as floor, at which all images were scored."""
        return tuple(self.images[0].margins) if self.images else ()

    @property
    def figures(self) -> dict[str, float]:
        """Figures by name; the reference's have the prefix `reference/`.

        Means over images, but for borders between objects, whose pixels are added up over images,
        as many images have none. Figures at other margins begin with theirs, as `8 mm/overlap_f`.
        """
        ours, theirs = self._figures("scores"), self._figures("reference")
        counts = {"images": float(self.number), "failures": float(len(self.failures))}
        competitor_figures = {
            f"{name}/{figure}": value
            for name in self.beside
            for figure, value in self._at([image.beside[name] for image in self.images]).items()
        }
        named = {f"{REFERENCE}/{name}": value for name, value in theirs.items()}
        return ours | named | competitor_figures | counts

    @property
    def beside(self) -> tuple[str, ...]:
        """Names of further methods."""
        return tuple(self.images[0].beside) if self.images else ()

    @property
    def measures(self) -> Mapping[str, Measure]:
        """Units, digits and published values of the figures."""
        return of_images(self.margins, self.beside, published=self.published)

    def _figures(self, source: Source) -> dict[str, float]:
        figures = self._means(source) | _seam_figures(self.seams(source))
        for margin in self.margins:
            margin_figures = self._at([image.margins[margin][source] for image in self.images])
            figures |= {f"{at_margin(margin)}/{name}": margin_figures[name] for name in OF_MARGINS}
        return figures

    def _at(self, scores: Sequence[Scored]) -> dict[str, float]:
        """Figures of all images by the scores of those that could be reconstructed."""
        masks = [s.masks for s in scores] + [f.scores for f in self.failures]
        seams = sum([*(s.seams for s in scores), *(f.seams for f in self.failures)], NO_SEAMS)
        return {name: _mean(masks, name) for name in SCORES} | _seam_figures(seams)

    def _means(self, source: Source) -> dict[str, float]:
        means = {name: _mean(self.scores(source), name) for name in SCORES}
        scores = [getattr(i, source) for i in self.images]
        scores += [f.scores for f in self.failures if f.objects is not None]
        return {**means, COUNT_ERROR: _mean(scores, COUNT_ERROR)}


COUNT_ERROR = "count_error"
SCORES = [f.name for f in fields(MaskScores) if f.name not in {"predicted", "true"}]
SCORES.append(COUNT_ERROR)
SEAMS = ("seam_f", "seam_precision", "seam_recall")


class LabelledMasks:
    """Scores a method on labelled depth images, beside a segmentation without learning.

    A pixel shows what the estimate's masks say. An estimate without masks has the instances of its
    volume at the points of pixels above the floor, so that borders come from the image and not from
    the silhouettes of voxels. A labelled image that no scene can be made of scores 0, and all its
    objects are missed.

    Args:
        input: a labelled depth image or a folder of them; those without labels are left out.
        method: makes the scenes.
        reference: segments the same images without learning.
        labels: of the images. Pixels without depth count for nothing.
        colour: moves ends of the reference's parts to edges of the colour image, as those of the
            method's; None: they stay.
        tolerance: see `mask_scores.mask_scores` and `seams.seam_scores`.
        margins: heights (m) up to which points belong to no object of either, for a table beside.
        beside: further methods by name, each for a row; None leaves one out.
        about: the images, for readers of the table, in sentences.
        published: whether these images are of the data set that published figures are of.

    Raises:
        ConfigError: no input is given.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - named as the setting on the command line
        method: Estimator,
        reference: CreaseSegmentation,
        labels: TrueLabels,
        colour: ColourEdges | None = None,
        tolerance: float = 0.003,
        margins: Sequence[float] = (),
        beside: Mapping[str, Estimator | None] | None = None,
        about: str = "",
        *,
        published: bool = False,
    ) -> None:
        if input is None:
            raise ConfigError(
                "scores on labelled images need input=FOLDER of labelled depth images"
            )
        self.input = Path(input)
        self.method = method
        self.reference, self.labels, self.colour = reference, labels, colour
        self.about, self.published = about, published
        self.tolerance = tolerance
        self.margins = tuple(margins)
        self.beside = {
            name: estimator for name, estimator in (beside or {}).items() if estimator is not None
        }

    def run(self, track: Track = lambda paths, _: paths) -> LabelledMaskResult:
        """Scores every labelled image; `track` wraps the loop in a progress bar.

        Raises:
            LabelsError: labels can't be read, or are of images of another size.
            InputError: no image has labels, or no labelled image could be used.
        """
        paths = find_images(self.input)
        images: list[ImageResult] = []
        failures: list[Failure] = []
        for path in track(paths, "labelled images"):
            try:
                true = self.labels.of(path)
                if true is not None:
                    images.append(self._score(read_frame(path), true))
            except LabelsError:
                raise
            except InputError as error:
                failures += self._failure(path, error)
        if not images and failures:
            raise InputError(f"no labelled image could be used; the first: {failures[0].reason}")
        if not images:
            raise InputError(
                f"none of the {len(paths)} images in {self.input} has labels; {self.labels.hint}"
            )
        return LabelledMaskResult(tuple(images), tuple(failures), self.about, self.published)

    def _score(self, frame: Frame, true: Int32) -> ImageResult:
        if true.shape != frame.depth.shape:
            raise LabelsError(
                f"labels of {frame.name} are of {true.shape[1]} x {true.shape[0]} pixels, its "
                f"depth of {frame.camera.width} x {frame.camera.height}; label images of one size"
            )
        true = np.where(frame.depth > 0, true, -1)
        estimate = self.method.estimate(frame)
        mine, plain = pixel_instances(estimate), self._plain(self.reference, estimate.frame)
        labels = {"true": true, "method": mine, "reference": plain}
        ours, theirs = (self._compare(predicted, true) for predicted in (mine, plain))
        return ImageResult(
            frame.name,
            ours.masks,
            theirs.masks,
            {name: image.astype(np.int16) for name, image in labels.items()},
            frame.colour,
            ours.seams,
            theirs.seams,
            {
                margin: self._at_margin(margin, mine, estimate.frame, true)
                for margin in self.margins
            },
            {
                name: self._compare(pixel_instances(method.estimate(frame)), true)
                for name, method in self.beside.items()
            },
        )

    def _at_margin(
        self, margin: float, mine: Int32, frame: Frame, true: Int32
    ) -> dict[str, Scored]:
        """Both methods without points up to this height (m)."""
        heights = world_points(frame)[..., 2]
        plain = self._plain(replace(self.reference, floor_margin=margin), frame)
        masks = {"scores": mine, "reference": plain}
        return {
            source: self._compare(_above(labels, heights, margin), true)
            for source, labels in masks.items()
        }

    def _plain(self, reference: CreaseSegmentation, frame: Frame) -> Int32:
        view = Observation(frame)
        parts = reference.segment(view)
        return parts if self.colour is None else self.colour.moved(parts, view)

    def _compare(self, predicted: Int32, true: Int32) -> Scored:
        return Scored(
            mask_scores(predicted, true, self.tolerance),
            seam_scores(predicted, true, self.tolerance),
        )

    def _failure(self, path: Path, error: InputError) -> list[Failure]:
        """The failed image, with its objects and borders; empty if it has no labels."""
        try:
            true = self.labels.of(path)
        except InputError:  # the same damage, or more: it may well have labels
            return [Failure(path.stem, str(error), None)]
        if true is None:
            return []
        missed = seam_scores(np.zeros_like(true), true, self.tolerance)
        return [Failure(path.stem, str(error), len(np.unique(true[true > 0])), missed)]


def pixel_instances(estimate: SceneEstimate) -> Int32:
    """Instances (H, W) that pixels show: the estimate's masks, or its volume at their points."""
    if estimate.masks is not None:
        return estimate.masks
    points = world_points(estimate.frame)
    above = points[..., 2] > _FLOOR  # NaN where no depth: not above
    return visible_instances(estimate.instances, points, estimate.grid, above)


def _above(labels: Int32, heights: Float64, margin: float) -> Int32:
    return np.where(heights > margin, labels, 0)  # NaN where no depth: not above


def _seam_figures(seams: Seams) -> dict[str, float]:
    return {name: getattr(seams, name) for name in SEAMS}


def _mean(scores: Sequence[MaskScores], name: str) -> float:
    return float(np.mean([getattr(score, name) for score in scores]))
