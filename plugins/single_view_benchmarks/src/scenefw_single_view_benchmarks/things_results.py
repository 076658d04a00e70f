"""What an evaluation of things found, image by image, and its figures with bounds."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.evaluation.stacks.methods import described
from scenefw.evaluation.statistics import Interval, bootstrap_interval, median_interval
from scenefw_single_view_benchmarks.confidence_results import (
    CONFIDENCE,
    ConfidenceResult,
    ObjectConfidence,
)
from scenefw_single_view_benchmarks.confidence_results import SCORES as CONFIDENCE_SCORES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from scenefw.core.types import Float64

TRUTH, RISING = "truth", "rising"
"""Rows of true scenes, and of a mask of all that rises above the floor."""
METHOD_MASKS, TRUE_MASKS = "method_masks", "true_masks"
"""Shapes of objects that a method has found, and of those that were marked for it."""


def _percent(
    heading: str, name: str = "", better: Literal["lower", "higher"] = "higher"
) -> Measure:
    return Measure(heading, name, "%", 1, better, 100.0)


def _mm(heading: str, name: str) -> Measure:
    return Measure(heading, name, "mm", 1, "lower", 1000.0)


MASKS = {
    "overlap_f": _percent("overlap F"),
    "boundary_f": _percent("boundary F"),
    "objects_f75": _percent("objects F ≥ 75"),
    "seam_f": _percent("between objects F"),
    "count_error": Measure("count error", digits=2, better="lower"),
}
SHAPES = {
    "matches": _percent("matched", "objects that a mask overlaps"),
    "chamfer": _mm("Chamfer", "Chamfer, mean of both directions"),
    "chamfer_visible": _mm("seen", "Chamfer of the seen surface"),
    "chamfer_hidden": _mm("hidden", "Chamfer of the hidden surface"),
    "f_5": _percent("F 5 mm"),
    "f_10": _percent("F 10 mm"),
    "iou": Measure("IoU", "IoU of voxels", digits=3, better="higher"),
    "recall": _percent("found", "objects with an IoU above 0.5"),
    "size_ratio": Measure("size", "predicted by true volume, geometric mean", digits=2),
    "size_error": Measure("size error", "factor by which volumes are off", "", 2, "lower"),
}
DRAWS = {
    "first": _mm("first", "Chamfer of the first hypothesis"),
    "energy": _mm("energy score", "energy score of Chamfer distances"),
    "best": _mm("best", "Chamfer of the best hypothesis of a scene"),
}
STANDING = {
    "stable": Measure("stable", "stable scenes", "%", 0, "higher", 100.0),
    "displacement": Measure(
        "moved", "displacement of objects, median of scenes", "cm", 1, "lower", 100.0
    ),
    "penetrating": _percent("run into others", "objects in others or the floor", "lower"),
    "hovering": _percent("hover", "objects that nothing carries", "lower"),
}
_GROUPS = {
    "masks": MASKS,
    METHOD_MASKS: SHAPES,
    TRUE_MASKS: SHAPES,
    "draws": DRAWS,
    "standing": STANDING,
}
_MIN_IOU = 0.5  # of objects that are found, as elsewhere


@dataclass(frozen=True)
class Draws:
    """Hypotheses of the marked objects of an image.

    Args:
        first: Chamfer distance of the first, mean over objects (m).
        energy: energy score of Chamfer distances, mean over objects (m).
        best: distance of the hypothesis whose objects are nearest on average (m).
    """

    first: float
    energy: float
    best: float


@dataclass(frozen=True)
class Standing:
    """Whether a scene can stand.

    Args:
        stable: 1 if nothing moves or turns far under gravity, else 0.
        displacement: of its objects, mean (m); NaN without any.
        penetrating: share of its objects that run into others or the floor.
        hovering: share that nothing carries.
    """

    stable: float
    displacement: float
    penetrating: float
    hovering: float


@dataclass(frozen=True)
class ThingImage:
    """One image.

    Args:
        stratum: of its scene.
        sensor: whose noise it has.
        scene: number of the scene in its stratum.
        kinds: name of each object that is seen well enough.
        refusals: why a method could not use the image, by method.
        masks: scores of masks by method, with the pixels of seams.
        shapes: by METHOD_MASKS or TRUE_MASKS, then by method, scores of each object; None: it has
            no match.
        draws: by method.
        standing: by method, and of the TRUTH.
        confidences: of the first method.
        notes: on how the image was read.
    """

    stratum: str
    sensor: str
    scene: int
    kinds: tuple[str, ...]
    refusals: Mapping[str, str] = field(default_factory=dict)
    masks: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    shapes: Mapping[str, Mapping[str, Sequence[Mapping[str, float] | None]]] = field(
        default_factory=dict
    )
    draws: Mapping[str, Draws] = field(default_factory=dict)
    standing: Mapping[str, Standing] = field(default_factory=dict)
    confidences: tuple[ObjectConfidence, ...] = ()
    notes: tuple[str, ...] = ()

    @classmethod
    def restored(cls, row: Mapping[str, Any]) -> ThingImage:
        """What `dataclasses.asdict` made JSON types of."""
        return cls(
            **{
                **row,
                "kinds": tuple(row["kinds"]),
                "notes": tuple(row["notes"]),
                "draws": {name: Draws(**draws) for name, draws in row["draws"].items()},
                "standing": {name: Standing(**s) for name, s in row["standing"].items()},
                "confidences": tuple(ObjectConfidence(**item) for item in row["confidences"]),
            }
        )


@dataclass(frozen=True)
class ThingsResult:
    """All images.

    Args:
        images: stratum by stratum, sensor by sensor.
        methods: names, those that learn nothing last.
        references: those that learn nothing, strongest first.
        voxel: side of the voxels of IoUs (m).
        draws: hypotheses of each image where they are judged as such.
        about: the images, for readers, in sentences.
    """

    images: tuple[ThingImage, ...]
    methods: tuple[str, ...]
    references: tuple[str, ...]
    voxel: float
    draws: int
    about: str = ""

    @property
    def groups(self) -> tuple[tuple[str, str], ...]:
        """Stratum and sensor of the images, in their order."""
        return tuple(dict.fromkeys((image.stratum, image.sensor) for image in self.images))

    @property
    def strata(self) -> tuple[str, ...]:
        """In the order of the images."""
        return tuple(dict.fromkeys(stratum for stratum, _ in self.groups))

    def of(self, stratum: str, sensor: str | None = None) -> tuple[ThingImage, ...]:
        """Images of a stratum, and of one sensor."""
        return tuple(
            image
            for image in self.images
            if image.stratum == stratum and sensor in (None, image.sensor)
        )

    def rows(self, group: str) -> tuple[str, ...]:
        """Methods that have figures of a group."""
        extra_rows = {"masks": (RISING,), "standing": (TRUTH,)}.get(group, ())
        return (*self.methods, *extra_rows)

    def interval(
        self, images: Sequence[ThingImage], group: str, method: str, name: str
    ) -> Interval:
        """A figure of some images with bootstrap bounds over scenes, which count alike."""
        if group == "masks" and name == "seam_f":
            return _seam_interval(images, method)
        pairs = [
            (image.scene, value)
            for image in images
            for value in _values(image, group, method, name)
        ]
        values = np.array([value for _, value in pairs], dtype=np.float64)
        scenes = [scene for scene, _ in pairs]
        if name == "displacement":
            return median_interval(values, scenes)
        is_ratio = name.startswith("size_")
        if is_ratio:
            values = np.log(np.where(values > 0, values, np.nan))
        statistic = _exponential if is_ratio else _first
        if name == "size_error":
            values = np.abs(values)
        return bootstrap_interval(values[:, None], scenes, statistic)

    @cached_property
    def confidence(self) -> ConfidenceResult:
        """Of all objects; their families are strata and sensors."""
        objects = tuple(item for image in self.images for item in image.confidences)
        return ConfidenceResult(objects, self.draws, frozenset(item.family for item in objects))

    @cached_property
    def figures(self) -> dict[str, float]:
        """`<stratum>/<sensor>/<group>/<method>/<name>` with bounds, and numbers of images."""
        figures: dict[str, float] = {}
        for stratum, sensor in self.groups:
            images = self.of(stratum, sensor)
            figures[f"{stratum}/{sensor}/images"] = float(len(images))
            figures[f"{stratum}/{sensor}/objects"] = float(sum(len(i.kinds) for i in images))
            for group, measures in _GROUPS.items():
                for method in self.rows(group):
                    for name in measures:
                        interval = self.interval(images, group, method, name)
                        key = f"{stratum}/{sensor}/{group}/{method}/{name}"
                        ends = {"": interval.mean, LOW: interval.low, HIGH: interval.high}
                        figures |= {f"{key}{end}": v for end, v in ends.items() if np.isfinite(v)}
        return figures | self._confidence_figures()

    def _confidence_figures(self) -> dict[str, float]:
        figures = {}
        for family in self.confidence.families:
            rows = self.confidence.rows_of(family)
            for name in CONFIDENCE_SCORES:
                value = self.confidence.score(CONFIDENCE, name, rows).mean
                if np.isfinite(value):
                    figures[f"{family}/confidence/{name}"] = value
        return figures

    @property
    def measures(self) -> dict[str, Measure]:
        """Units and digits; the first reference is the trivial value of each method's figure."""
        measures: dict[str, Measure] = {}
        for stratum, sensor in self.groups:
            where = f"{stratum}/{sensor}"
            measures[f"{where}/images"] = Measure("images", digits=0)
            measures[f"{where}/objects"] = Measure("objects", digits=0)
            for group, of_group in _GROUPS.items():
                for method in self.rows(group):
                    for name, measure in of_group.items():
                        title = f"{measure.name or measure.heading}, {described(method).name}"
                        measures[f"{where}/{group}/{method}/{name}"] = replace(
                            measure,
                            name=f"{title}, {group}",
                            trivial=self._trivial(where, group, method, name),
                        )
            for name, measure in CONFIDENCE_SCORES.items():
                measures[f"{where}/confidence/{name}"] = measure
        return measures

    def _trivial(self, where: str, group: str, method: str, name: str) -> str | None:
        is_learned = method in self.methods and method not in self.references
        if not is_learned or not self.references:
            return None
        return f"{where}/{group}/{self.references[0]}/{name}"


def _values(image: ThingImage, group: str, method: str, name: str) -> list[float]:
    """Figures of an image, one for each object or one in all; NaN: there is none."""
    if group in (METHOD_MASKS, TRUE_MASKS):
        return [_of_object(row, name) for row in image.shapes.get(group, {}).get(method, ())]
    of_group: Mapping[str, Any] = getattr(image, group)
    if method not in of_group:
        return []
    scores = of_group[method]
    return [float(scores[name] if group == "masks" else getattr(scores, name))]


def _of_object(row: Mapping[str, float] | None, name: str) -> float:
    if name == "matches":
        return float(row is not None)
    if row is None:
        return 0.0 if name in ("f_5", "f_10", "iou", "recall") else float("nan")
    if name == "recall":
        return float(row["iou"] > _MIN_IOU)
    return float(row["size_ratio" if name == "size_error" else name])


def _first(means: Float64) -> Float64:
    return np.asarray(means[..., 0])


def _exponential(means: Float64) -> Float64:
    return np.asarray(np.exp(means[..., 0]))


def _seam_interval(images: Sequence[ThingImage], method: str) -> Interval:
    """Borders between objects, whose pixels are added up over images, as many have none."""
    names = ("hits", "predicted", "true_hits", "true")
    rows = [image.masks[method] for image in images if method in image.masks]
    scenes = [image.scene for image in images if method in image.masks]
    values = np.array([[row[name] for name in names] for row in rows]).reshape(-1, 4)
    statistic: Callable[[Float64], Float64] = _seam_f
    return bootstrap_interval(values, scenes, statistic)


def _seam_f(means: Float64) -> Float64:
    precision = means[..., 0] / np.maximum(means[..., 1], 1e-9)
    recall = means[..., 2] / np.maximum(means[..., 3], 1e-9)
    return np.asarray(2 * precision * recall / np.maximum(precision + recall, 1e-9))
