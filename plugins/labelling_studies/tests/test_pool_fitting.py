from dataclasses import astuple

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw.labelling.pooling import Pool, Weights
from scenefw_labelling_studies.pool_fitting import fit_pool


def normal(values):
    return (values / values.sum(axis=0)).astype(np.float32)


def expert(rng, truth, right):
    """Probabilities whose argmax is the truth in a share of cases, 0.9 sure whatever it is."""
    said = np.where(rng.random(len(truth)) < right, truth, rng.integers(0, 3, len(truth)))
    return np.where(np.arange(3)[:, None] == said, 0.9, 0.05).astype(np.float32)


def test_calibration_finds_the_better_expert_of_each_place():
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 3, 6000)
    well = (np.arange(6000) % 2).astype(np.float32)
    poor_map, good_map, views = (expert(rng, truth, share) for share in (0.3, 0.95, 0.7))
    of_map = np.where(well > 0, good_map, poor_map)
    found = fit_pool(views, of_map, well, truth)
    for weights in (found.surface, found.objects):
        assert weights.map_well > weights.views_well > 0
        assert weights.map_poor < weights.views_poor
    correct = [np.mean(p.argmax(axis=0) == truth) for p in (views, of_map)]
    pooled = found(views, of_map, well)
    assert np.mean(pooled.argmax(axis=0) == truth) > max(correct) + 0.05
    # calibrated: it is right as often as it is sure
    assert pooled.max(axis=0).mean() == pytest.approx(
        np.mean(pooled.argmax(axis=0) == truth), abs=0.03
    )


def test_calibration_finds_the_weights_that_made_the_truth():
    rng = np.random.default_rng(2)
    views, of_map = (normal(rng.dirichlet([0.6] * 4, 60_000).T) for _ in range(2))
    well = rng.random(60_000).astype(np.float32)
    made = Pool(Weights(0.4, 0.1, 0.2, 1.4, -0.6, 0.4), Weights(1.2, 0.3, 0.5, 0.9), doubt=0.01)
    given = made(views, of_map, well)
    truth = (rng.random(60_000) < given.cumsum(axis=0)).argmax(axis=0).astype(np.int32)
    found = fit_pool(views, of_map, well, truth, np.zeros_like(truth), doubt=0.01)
    assert astuple(found.surface) == pytest.approx(astuple(made.surface), abs=0.1)
    assert astuple(found.objects) == pytest.approx(astuple(made.objects), abs=0.1)


def test_the_expert_of_outlines_and_the_expert_of_kinds_both_have_their_say():
    rng = np.random.default_rng(3)
    truth = rng.integers(0, 3, 6000)
    # Views know which object it is and bleed onto the surface; the map mixes the objects up
    on_views = np.where((truth == 0) & (rng.random(6000) < 0.5), 1, truth)
    on_map = np.where((truth > 0) & (rng.random(6000) < 0.5), 3 - truth, truth)
    views, of_map = (
        np.where(np.arange(3)[:, None] == said, 0.9, 0.05).astype(np.float32)
        for said in (on_views, on_map)
    )
    well = np.ones(6000, np.float32)
    pooled = fit_pool(views, of_map, well, truth)(views, of_map, well)
    assert np.mean(pooled.argmax(axis=0) == truth) > 0.99


def test_a_vertex_counts_to_the_class_that_it_was_drawn_for():
    rng = np.random.default_rng(1)
    truth = np.repeat([0, 1], [40_000, 500])
    drawn_for = truth.copy()
    drawn_for[:500] = 1  # surface that views take for an object
    said = np.where(np.arange(len(truth)) < 500, 1, truth)
    views = np.where(np.arange(3)[:, None] == said, 0.9, 0.05).astype(np.float32)
    of_map = expert(rng, truth, 0.9)
    well = np.ones(len(truth), np.float32)
    by_truth = fit_pool(views, of_map, well, truth)
    assert by_truth == fit_pool(views, of_map, well, truth, truth)
    as_drawn = fit_pool(views, of_map, well, truth, drawn_for)

    def right_at_outlines(weights):
        pooled = weights(views, of_map, well)
        return np.mean(pooled.argmax(axis=0)[:500] == truth[:500])

    assert right_at_outlines(by_truth) < 0.1
    assert right_at_outlines(as_drawn) > 0.9


def test_calibration_needs_vertices():
    nothing = np.zeros((3, 0), np.float32)
    with pytest.raises(InputError, match="no vertex"):
        fit_pool(nothing, nothing, np.zeros(0), np.zeros(0, np.int32))


def test_calibration_takes_what_there_is():
    rng = np.random.default_rng(4)
    surface_alone = np.zeros(50, np.int32)
    views, well = expert(rng, surface_alone, 0.9), np.ones(50, np.float32)
    found = fit_pool(views, views, well, surface_alone)
    assert found(views, views, well).argmax(axis=0).tolist() == [0] * 50
    one_kind = np.repeat([0, 1], 25)
    views = np.where(np.arange(2)[:, None] == one_kind, 0.9, 0.1).astype(np.float32)
    found = fit_pool(views, views, well, one_kind)
    assert found(views, views, well).argmax(axis=0).tolist() == one_kind.tolist()
