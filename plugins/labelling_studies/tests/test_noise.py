"""Strategies compared under noise, scene by scene."""

import numpy as np
import pytest
from scipy import stats

from scenefw_labelling_studies.noise import NoiseResult
from scenefw_labelling_studies.results import Score, Scores


def row(strategy, scene, miou, pose=0.0):
    return Score(
        strategy=strategy, scene=scene, frames=5, miou=miou, miou_seen=miou, coverage=1.0,
        seconds=0.0, height_rms=0.0, height_median=0.0, pose=pose, depth=0.0,
    )  # fmt: skip


def test_differences_are_paired_by_scene():
    ours, theirs = np.array([0.5, 0.7, 0.3, 0.6]), np.array([0.45, 0.66, 0.22, 0.57])
    rows = [row("hybrid", scene, miou) for scene, miou in enumerate(ours)]
    rows += [row("map", scene, miou) for scene, miou in reversed(list(enumerate(theirs)))]
    rows += [row("hybrid", 9, 0.0), row("map", 0, 0.0, pose=0.1)]  # without a partner
    found = NoiseResult(Scores(tuple(rows))).difference("hybrid", "map", 0.0, 0.0)
    t = stats.ttest_rel(ours, theirs).confidence_interval(0.95)
    assert found.mean == pytest.approx(0.05)
    assert (found.low, found.high) == pytest.approx((t.low, t.high))
    assert found.count == 4
