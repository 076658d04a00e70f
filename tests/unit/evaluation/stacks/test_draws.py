"""Samples as samples: pairs and owners by brute force, skills of known forecasters, references."""

from itertools import combinations

import numpy as np
import pytest
import torch
from tests.unit.evaluation.stacks.test_reconstruction import Nothing, evaluation
from tests.unit.perception.pipelines import pipeline_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.stacks.draw_results import DrawsResult, DrawView, half, scores
from scenefw.evaluation.stacks.draws import DrawScoring, Truth, hidden_objects, owners_of, pairs_of
from scenefw.evaluation.stacks.training_mean import TrainingMean
from scenefw.perception.completion.partial_surface import PartialSurface
from scenefw.perception.grouping.hulls import HullFilling
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation
from scenefw.postprocessing.connected_components import ConnectedComponents
from scenefw.representations.volumes import scene_volumes

pytestmark = pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")


def ball_truth(resolution, seed=0):
    """Two balls, all of them seen but for one half of space."""
    grid = GridSpec(resolution=resolution)
    centres = grid.centres()
    balls = np.array([[0.1, 0.0, 0.2], [-0.15, 0.05, 0.2]])
    apart = np.linalg.norm(centres[..., None, :] - balls, axis=-1) - 0.11
    distance = apart.min(axis=-1).clip(-grid.truncation, grid.truncation).astype(np.float32)
    labels = np.where(distance < 0, apart.argmin(axis=-1) + 1, 0).astype(np.int32)
    rng = np.random.default_rng(seed)
    spread = rng.normal(size=(40, 3))
    owner = rng.integers(0, 2, 40)
    points = balls[owner] + 0.11 * spread / np.linalg.norm(spread, axis=1, keepdims=True)
    unseen = (centres[..., 1] > 0) & (centres[..., 2] > 0)
    return Truth(distance, labels, unseen, points, grid), owner


def scoring(grid_scenes=8, **settings):
    scenes = StackScenes(split="train", limit=grid_scenes)
    return DrawScoring(TrainingMean(scenes), StackScenes(split="val", limit=2), **settings)


def tensors(*samples):
    return [(torch.from_numpy(t), torch.from_numpy(i)) for t, i in samples]


@pytest.mark.parametrize("resolution", [32, 48])
def test_points_on_surfaces_belong_to_the_nearest_labelled_voxel(resolution):
    truth, owner = ball_truth(resolution)
    found = owners_of(truth.points, truth.instances, truth.grid)
    voxels = np.argwhere(truth.instances)
    for point, label in zip(truth.points, found, strict=True):
        gaps = np.linalg.norm(truth.grid.to_world(voxels) - point, axis=1)
        assert truth.instances[tuple(voxels[gaps.argmin()])] == label
    assert (found == owner + 1).all()
    far = np.array([[0.4, 0.4, 0.6], [2.0, 0, 0]])
    assert owners_of(far, truth.instances, truth.grid).tolist() == [0, 0]


def test_pairs_of_points_one_by_one():
    truth, owner = ball_truth(32)
    same, gaps = pairs_of(truth)
    pairs = list(combinations(range(40), 2))
    assert same.tolist() == [owner[a] == owner[b] for a, b in pairs]
    assert np.allclose(gaps, [np.linalg.norm(truth.points[a] - truth.points[b]) for a, b in pairs])


def test_the_truth_is_perfect_and_merged_objects_are_not():
    truth, _ = ball_truth(32)
    merged = (truth.instances > 0).astype(np.int32)
    judge = scoring().judge
    right = judge(tensors((truth.tsdf, truth.instances)), truth, [0.0])
    wrong = judge(tensors((truth.tsdf, merged)), truth, [0.0])
    assert right.to_truth.tolist() == [0.0]
    assert (right.instance_iou, right.occupancy_iou) == (1.0, 1.0)
    assert right.pairs.true[0] == 0
    assert right.pairs.true[1] == right.pairs.total[1]
    assert wrong.pairs.total[0] == 0  # it says of all pairs that they are one
    assert wrong.to_truth[0] == pytest.approx(0.75, abs=0.02)  # half of two, by the larger set
    maps = DrawsResult((), (DrawView(0, {"a": right}),), ("a",), 1).maps["a"]
    found = scores(right, maps)
    assert found["log"] < 0.05 * found["trivial_log"]
    assert found["pairs_log"] < 0.05


def test_voxels_are_counted_once_seen_or_unseen():
    truth, _ = ball_truth(32)
    outcome = scoring().judge(tensors((truth.tsdf, truth.instances)), truth, [0.0])
    assert half(outcome.occupancy, 0).total.sum() == (~truth.unseen).sum()
    assert half(outcome.occupancy, 1).total.sum() == truth.unseen.sum()
    assert half(outcome.occupancy, 1).true.sum() == ((truth.tsdf < 0) & truth.unseen).sum()


def test_samples_that_disagree_share_their_votes():
    truth, _ = ball_truth(32)
    merged = (truth.instances > 0).astype(np.int32)
    samples = tensors((truth.tsdf, truth.instances), (truth.tsdf, merged))
    outcome = scoring().judge(samples, truth, [0.0] * len(samples))
    assert outcome.pairs.total[0] == 0
    assert outcome.pairs.true[1] == 0  # one of two says so: never true here
    assert outcome.pairs.forecast[1] == pytest.approx(outcome.pairs.total[1] / 2)
    assert outcome.among[0, 1] == outcome.to_truth[1]


@pytest.mark.parametrize("resolution", [16, 24])
def test_hidden_objects_are_those_of_which_nothing_is_seen(resolution):
    labels = np.zeros((resolution,) * 3, np.int32)
    half = resolution // 2
    labels[:half, :half], labels[half:, half:] = 2, 5
    unseen = np.zeros(labels.shape, bool)
    assert hidden_objects(labels, unseen) == 0
    unseen[half:] = True
    assert hidden_objects(labels, unseen) == 1
    unseen[half:, half:, 0] = False  # one side of it shows
    assert hidden_objects(labels, unseen) == 0
    assert hidden_objects(labels, np.ones_like(unseen)) == 2
    assert hidden_objects(np.zeros_like(labels), unseen) == 0


@pytest.mark.parametrize("resolution", [16, 24])
def test_the_training_mean_is_that_of_its_scenes(resolution):
    grid, scenes = GridSpec(resolution=resolution), StackScenes(split="train", limit=20)
    mean = TrainingMean(scenes)
    inside = scene_volumes(scenes.parameters(list(range(20))), grid).tsdf[:, 0] < 0
    share = inside.double().mean(dim=0).numpy()
    rate = share.mean()
    assert mean.rate(grid) == pytest.approx(rate)
    assert np.allclose(mean.probability(grid), (20 * share + rate) / 21)
    assert 0 < mean.probability(grid).min() < mean.probability(grid).max() < 1


@pytest.fixture(scope="module")
def result():
    parts = CreaseSegmentation(0.01, 0.02, 25.0, 8, 320, grow=False)
    methods = {
        "hull_filling": pipeline_of(segmentation=parts, grouping=HullFilling()),
        "partial_tsdf": pipeline_of(PartialSurface(ConnectedComponents())),
        "nothing": Nothing(),
    }
    scenes = StackScenes(split="val", limit=6)
    draws = scoring(64, count=2, scenes=5, methods={"further": Nothing()})
    grid = GridSpec(resolution=32)
    return evaluation(methods, scenes, views=1, samples=1, grid=grid, draws=draws).run()


def test_no_straw_man(result):
    """What learns nothing and fills hulls is far better than what leaves hidden space free."""
    figures = result.figures
    weaker = {name: figures[f"partial_tsdf/{name}"] for name in ("occupancy_iou", "instance_iou")}
    assert figures["occupancy_iou"] > weaker["occupancy_iou"] + 0.1
    assert figures["instance_iou"] > weaker["instance_iou"] + 0.1
    assert figures["chamfer_full_excess"] < figures["partial_tsdf/chamfer_full_excess"]
    assert figures["draws/hull_filling/energy"] < figures["draws/partial_tsdf/energy"]
    for name in ("log_skill", "brier_skill"):
        assert figures[f"draws/hull_filling/{name}"] > figures[f"draws/partial_tsdf/{name}"] + 0.1
    assert figures["draws/hull_filling/log_skill"] > 0


def test_forecasts_without_an_image_stand_beside(result):
    figures = result.figures
    assert figures["training_mean/occupancy_bce"] < figures["base_rate/occupancy_bce"]
    assert figures["base_rate/occupancy_bce"] < figures["nothing/occupancy_bce"]
    assert result.measures["occupancy_bce"].trivial == "base_rate/occupancy_bce"


def test_draws_are_of_the_first_scenes_alone(result):
    assert [view.scene for view in result.draws.views] == [v.scene for v in result.views[:5]]
    assert len(result.views) == 6
    assert len(result.draws.calibration) == 2
    assert set(result.draws.views[0].methods) == {*result.draws.methods}
    assert "further" in result.draws.methods
    assert "draws/further/log_skill" in result.figures
    interval = result.draws.intervals["nothing"]["energy"]
    assert (interval.mean, interval.low, interval.high) == (1.0, 1.0, 1.0)
    for name, value in result.figures.items():
        assert np.isfinite(value), name


def test_bounds_hold_their_mean(result):
    figures = result.figures
    for name in ("instance_iou", "draws/hull_filling/energy"):
        assert figures[f"{name}_low"] <= figures[name] <= figures[f"{name}_high"]


def test_bad_numbers_are_named():
    with pytest.raises(ConfigError, match="count = 0"):
        scoring(count=0)


def test_draws_are_held_against_the_first(result):
    """One draw is its own measure; a method that draws no hidden objects scores their number."""
    figures = result.figures
    assert figures["draws/hull_filling/chamfer_visible_ratio"] == 1.0
    for view in result.draws.views:
        for name, outcome in view.methods.items():
            assert len(outcome.chamfer_visible) == len(outcome.hidden_objects)
            assert outcome.chamfer_visible.min() > 0, name
    hidden = figures["draws/hull_filling/hidden_true"]
    assert hidden == np.mean([v.methods["nothing"].truly_hidden for v in result.draws.views])
    assert figures["draws/nothing/hidden_score"] == pytest.approx(hidden)  # it draws none


def test_the_ratio_is_of_means_over_views():
    truth, _ = ball_truth(32)
    samples = tensors(*[(truth.tsdf, truth.instances)] * 3)
    outcomes = [scoring().judge(samples, truth, distances) for distances in ([1, 2, 4], [3, 3, 3])]
    views = tuple(DrawView(i, {"one": outcome}) for i, outcome in enumerate(outcomes))
    found = DrawsResult(views, views, ("one",), 3).intervals["one"]
    assert found["chamfer_visible_ratio"].mean == pytest.approx((3 + 3) / (1 + 3))
