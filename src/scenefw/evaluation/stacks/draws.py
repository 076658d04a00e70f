"""Samples of one view judged as samples: what they say of space and of what belongs together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from scenefw.core.protocols import Reconstructor
from scenefw.core.settings import COUNT
from scenefw.core.types import Float64, GridSpec, Int32
from scenefw.data.batches.stacks import StackScenes
from scenefw.evaluation.stacks.training_mean import TrainingMean
from scenefw.metrics.forecasts import Outcomes, log_odds_classes
from scenefw.metrics.instances import scores_of
from scenefw.metrics.object_sets import LabelSets
from scenefw.metrics.occupancy import coverage, occupancy_iou, probable_occupancy

Bool = NDArray[np.bool_]

LOG_ODDS = np.linspace(-4.75, 4.75, 77)
"""Borders between classes of occupancy; a distance of one voxel is log odds of one."""
DISTANCES = np.linspace(0.02, 0.5, 25)
"""Borders between classes of pairs by their distance (m)."""
_HIDDEN = 0.98  # share of a hidden object's voxels that are unseen
_REACH = 2  # voxels within which a point on a surface looks for its object
VISIBLE_POINTS = 200
"""Points on the visible surface of each view; all their pairs are asked."""


@dataclass(frozen=True)
class Truth:
    """What samples of one view are compared with, on one grid.

    Args:
        tsdf: (X, Y, Z) metres.
        instances: (X, Y, Z) labels.
        unseen: (X, Y, Z) voxels above the floor that the view doesn't show.
        points: (P, 3) on the visible surface (m).
        grid: of the volumes.
    """

    tsdf: NDArray[np.float32]
    instances: Int32
    unseen: Bool
    points: Float64
    grid: GridSpec


@dataclass(frozen=True)
class DrawOutcome:
    """One method's samples of one view.

    Args:
        occupancy: of voxels; the classes of seen voxels come first, then as many of unseen ones.
        pairs: of pairs of visible points, by how many samples put both into one object.
        pairs_by_distance: the same pairs by their distance.
        trivial: log and Brier scores of the training mean, of all voxels and of unseen ones.
        coverage: share of unseen voxels near surfaces whose distance lies within the samples'.
        to_truth: (S,) distances of the sets of objects to the true set.
        among: (S, S) distances among them.
        instance_iou, panoptic_quality, occupancy_iou: (S,) of each sample.
        chamfer_visible: (S,) metres, of each sample's visible surface from the true one.
        hidden_objects: (S,) of each sample, objects that the view doesn't show.
        truly_hidden: how many there are.
    """

    occupancy: Outcomes
    pairs: Outcomes
    pairs_by_distance: Outcomes
    trivial: Mapping[str, float]
    coverage: float
    to_truth: Float64
    among: Float64
    instance_iou: Float64
    panoptic_quality: Float64
    occupancy_iou: Float64
    chamfer_visible: Float64
    hidden_objects: Float64
    truly_hidden: int


class DrawScoring:
    """Judges samples; probabilities are calibrated on scenes of the validation split.

    Args:
        mean: the forecast without an image.
        calibration: scenes on whose views probabilities are calibrated.
        methods: by name, that are judged by their samples alone; None leaves one out.
        count: samples per view.
        scenes: at most so many test scenes.

    Raises:
        ConfigError: a number is below one.
    """

    def __init__(
        self,
        mean: TrainingMean,
        calibration: StackScenes,
        methods: Mapping[str, Reconstructor | None] | None = None,
        count: int = 10,
        scenes: int = 30,
    ) -> None:
        COUNT.require(count=count, scenes=scenes)
        self.mean, self.calibration = mean, calibration
        self.methods = {
            name: method for name, method in (methods or {}).items() if method is not None
        }
        self.count, self.scenes = count, scenes

    def judge(
        self,
        samples: Sequence[tuple[Tensor, Tensor]],
        truth: Truth,
        chamfer_visible: Sequence[float] = (),
    ) -> DrawOutcome:
        """Outcomes of samples: distances (X, Y, Z) metres and instances (X, Y, Z) of each.

        `chamfer_visible` has each sample's Chamfer distance of visible surfaces (m); views that
        are for calibration alone need none.
        """
        volumes = np.stack([tsdf.cpu().numpy() for tsdf, _ in samples])
        labels, occupied = [instances.cpu().numpy() for _, instances in samples], truth.tsdf < 0
        hidden = truth.unseen & (np.abs(truth.tsdf) < truth.grid.truncation)
        sets = LabelSets([truth.instances, *labels])
        indices = range(1, len(labels) + 1)
        sample_scores = [scores_of(sets.iou(i, 0)) for i in indices]
        same_object, pairs_apart = pairs_of(truth)
        return DrawOutcome(
            occupancy_outcomes(volumes, truth),
            _pair_outcomes(labels, truth, same_object),
            _distance_outcomes(pairs_apart, same_object),
            trivial_scores(self.mean.probability(truth.grid), occupied, truth.unseen),
            coverage(volumes, truth.tsdf, hidden),
            np.array([sets.distance(i, 0) for i in indices]),
            sets.distances(indices),
            np.array([scores.iou for scores in sample_scores]),
            np.array([scores.panoptic_quality for scores in sample_scores]),
            np.array([occupancy_iou(shape < 0, occupied) for shape in volumes]),
            np.asarray(chamfer_visible, dtype=np.float64),
            np.array(
                [hidden_objects(instances, truth.unseen) for instances in labels], dtype=np.float64
            ),
            hidden_objects(truth.instances, truth.unseen),
        )


def hidden_objects(labels: Int32, unseen: Bool) -> int:
    """Objects (X, Y, Z) of which hardly any voxel is seen or lies just behind a seen surface."""
    count = int(labels.max(initial=0)) + 1
    totals = np.bincount(labels.ravel(), minlength=count)[1:]
    out_of_sight = np.bincount(labels[unseen], minlength=count)[1:]
    return int((out_of_sight > _HIDDEN * totals).sum())


def occupancy_outcomes(volumes: NDArray[np.float32], truth: Truth) -> Outcomes:
    """Outcomes of voxels by the mean over samples of 1 / (1 + exp(distance / voxel))."""
    raw = probable_occupancy(volumes, truth.grid.voxel_size)
    count = len(LOG_ODDS) + 1
    classes = log_odds_classes(raw, LOG_ODDS) + count * truth.unseen
    return Outcomes.of(classes, raw, truth.tsdf < 0, 2 * count)


def trivial_scores(probability: Float64, occupied: Bool, unseen: Bool) -> dict[str, float]:
    """Log and Brier scores of a probability per voxel."""
    logs = -np.log(np.where(occupied, probability, 1 - probability))
    squares = (occupied - probability) ** 2
    return {
        "log": float(logs.mean()),
        "brier": float(squares.mean()),
        "log_unseen": float(logs[unseen].mean()) if unseen.any() else float("nan"),
        "brier_unseen": float(squares[unseen].mean()) if unseen.any() else float("nan"),
    }


def pairs_of(truth: Truth) -> tuple[Bool, Float64]:
    """Of all pairs of visible points: whether they belong to one object, and their distance (m)."""
    owners = owners_of(truth.points, truth.instances, truth.grid)
    first, second = np.triu_indices(len(owners), 1)
    gaps = np.linalg.norm(truth.points[first] - truth.points[second], axis=1)
    return _together(owners), gaps


def owners_of(points: Float64, labels: Int32, grid: GridSpec) -> Int32:
    """Label (P,) of the labelled voxel whose centre is nearest; 0 if none is within reach."""
    offsets = np.stack(
        np.meshgrid(*[np.arange(-_REACH, _REACH + 1)] * 3, indexing="ij"), axis=-1
    ).reshape(-1, 3)
    places = grid.to_voxels(points)
    voxels = np.rint(places).astype(int)[:, None] + offsets
    inside = np.all((voxels >= 0) & (voxels < grid.resolution), axis=-1)
    x, y, z = np.moveaxis(np.where(inside[..., None], voxels, 0), -1, 0)
    candidates = labels[x, y, z]
    gaps = np.linalg.norm(voxels - places[:, None], axis=-1)
    gaps = np.where(inside & (candidates > 0), gaps, np.inf)
    best = gaps.argmin(axis=1)
    rows = np.arange(len(points))
    return np.where(np.isfinite(gaps[rows, best]), candidates[rows, best], 0).astype(np.int32)


def _together(owners: Int32) -> Bool:
    """Whether the points of each pair have the same owner; nobody owns two."""
    first, second = np.triu_indices(len(owners), 1)
    return np.asarray((owners[first] == owners[second]) & (owners[first] > 0))


def _pair_outcomes(labels: Sequence[Int32], truth: Truth, same_object: Bool) -> Outcomes:
    votes = np.sum(
        [_together(owners_of(truth.points, instances, truth.grid)) for instances in labels], axis=0
    )
    return Outcomes.of(votes, votes / len(labels), same_object, len(labels) + 1)


def _distance_outcomes(gaps: Float64, same_object: Bool) -> Outcomes:
    classes = np.searchsorted(DISTANCES, gaps)
    return Outcomes.of(classes, same_object.astype(np.float64), same_object, len(DISTANCES) + 1)
