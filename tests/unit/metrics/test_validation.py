"""Figures of a validation, by hand and against the metrics of evaluation."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import ShapeInstanceSetup
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.metrics.absolute_error import AbsoluteError
from scenefw.metrics.expected_occupancy import ExpectedOccupancy
from scenefw.metrics.occupancy import binary_cross_entropy, expected_occupancy, occupancy_iou
from scenefw.metrics.occupancy_overlap import OccupancyOverlap
from scenefw.metrics.vote_angle import VoteAngle

GRID = GridSpec(8)


def test_figures_of_a_known_prediction():
    truth = torch.ones(1, 1, 2, 2, 2)
    truth[0, 0, 0] = -0.5
    guess = torch.ones(1, 1, 2, 2, 2)
    guess[0, 0, 0, 0] = -0.5
    votes = torch.zeros(1, 3, 2, 2, 2)
    votes[0, 0, 0] = 1
    turned = torch.zeros(1, 3, 2, 2, 2)
    turned[0, 0, 0], turned[0, 1, 0] = 2, 2
    true, predicted = {"tsdf": truth, "votes": votes}, {"tsdf": guess, "votes": turned}
    assert float(OccupancyOverlap()(predicted, true, GRID)) == pytest.approx(2 / 4)
    assert float(AbsoluteError(in_truncations=False)(predicted, true, GRID)) == pytest.approx(
        2 * 1.5 / 8
    )
    found = AbsoluteError(in_truncations=True)(predicted, true, GRID)
    assert float(found) == pytest.approx(2 * 1.5 / 8 / GRID.truncation)
    assert float(VoteAngle()(predicted, true, GRID)) == pytest.approx(45, abs=1e-3)


@pytest.mark.parametrize("resolution", [4, 8])
def test_figures_of_samples_are_those_of_evaluation(resolution):
    shape = (5, 1, *(resolution,) * 3)
    samples = torch.randn((3, *shape), generator=torch.Generator().manual_seed(1))
    truth = torch.randn(shape, generator=torch.Generator().manual_seed(2))
    predicted, true = {"tsdf": samples}, {"tsdf": truth}
    occupied = truth.numpy() < 0
    expected = binary_cross_entropy(expected_occupancy(samples.numpy()), occupied)
    assert float(ExpectedOccupancy()(predicted, true, GRID)) == pytest.approx(expected)
    overlaps = [occupancy_iou(sample.numpy() < 0, occupied) for sample in samples]
    found = OccupancyOverlap(of_samples=True)(predicted, true, GRID)
    assert float(found) == pytest.approx(np.mean(overlaps))


@pytest.mark.parametrize(
    "metric",
    [
        OccupancyOverlap(),
        AbsoluteError("votes", in_truncations=False),
        VoteAngle(),
        ExpectedOccupancy(),
    ],
)
def test_a_missing_volume_is_found_before_the_work(metric):
    metric.check(ShapeInstanceSetup(GRID, {"tsdf": 1, "votes": 3}, 2, 0))
    with pytest.raises(ConfigError, match="but the representations are mine") as caught:
        metric.check(ShapeInstanceSetup(GRID, {"mine": 1}, 2, 0))
    assert "\n" not in str(caught.value)


def test_two_empty_scenes_overlap_as_everywhere_else():
    empty = {"tsdf": torch.ones(1, 1, 2, 2, 2)}
    assert float(OccupancyOverlap()(empty, empty, GRID)) == 1
    assert occupancy_iou(empty["tsdf"].numpy() < 0, empty["tsdf"].numpy() < 0) == 1
