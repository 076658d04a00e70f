"""Sets of voxels counted one by one, and pairs of voxels."""

import itertools

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw.metrics.decomposition import decomposition_scores, set_overlaps


def random_sets(seed, predictions, objects, voxels=27):
    """Predictions are objects with some voxels changed, so that all kinds of errors come up."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, objects + 1, voxels)
    true = np.stack([labels == i + 1 for i in range(objects)])
    rows = []
    for _ in range(predictions):
        row = true[rng.choice(objects, rng.integers(1, 3))].any(axis=0)
        row = row & (rng.random(voxels) < rng.choice([0.4, 0.8, 1.0]))
        rows.append(row | (rng.random(voxels) < 0.05))
    predicted = np.stack(rows)
    return predicted[predicted.any(axis=1)], true[true.any(axis=1)]


def by_hand(predicted, true):
    """The definitions, over sets of voxels, with every way to match tried."""
    mine = [set(np.flatnonzero(row)) for row in predicted]
    theirs = [set(np.flatnonzero(row)) for row in true]

    def iou(p, t):
        return len(p & t) / len(p | t)

    slots = [*range(len(theirs)), *[None] * len(mine)]
    matched, best = (), -1.0
    for order in itertools.permutations(slots, len(mine)):
        total = sum(iou(mine[i], theirs[t]) for i, t in enumerate(order) if t is not None)
        if total > best + 1e-12:
            matched, best = order, total
    missing = sum(all(iou(p, t) < 0.25 for p in mine) for t in theirs)
    joined = sum(sum(len(p & t) >= 0.5 * len(t) for t in theirs) >= 2 for p in mine)
    duplicate = 0
    for i, p in enumerate(mine):
        others = [t for t in matched if t is not None and t != matched[i]]
        duplicate += any(iou(p, theirs[t]) >= 0.25 for t in others)
    split = 0
    for t in theirs:
        inside = [p for p in mine if len(p & t) >= 0.5 * len(p)]
        split += len(inside) >= 2 and all(iou(p, t) < 0.5 for p in mine)
    return best / len(theirs), missing, joined, duplicate, split, len(mine) - len(theirs)


def test_random_sets_score_as_counted_by_hand():
    kinds = np.zeros(4)
    for seed, (predictions, objects) in itertools.product(range(25), [(2, 2), (4, 2), (3, 3)]):
        predicted, true = random_sets(seed, predictions, objects)
        if not len(predicted) or not len(true):
            continue
        found, expected = decomposition_scores(predicted, true), by_hand(predicted, true)
        assert found.object_iou == pytest.approx(expected[0])
        assert tuple(found[1:]) == expected[1:]
        kinds += np.array(found[1:5]) > 0
    assert (kinds >= 3).all()  # every kind of error came up


@pytest.fixture
def two():
    """Two objects of 8 voxels each."""
    true = np.zeros((2, 4, 4, 4), bool)
    true[0, :2, :2, :2] = true[1, 2:, 2:, 2:] = True
    return true


def test_single_errors(two):
    first, second = two
    half = first.copy()
    half[0] = False
    cases = {
        "perfect": (two[::-1], (1.0, 0, 0, 0, 0, 0)),
        "missing": (first[None], (0.5, 1, 0, 0, 0, -1)),
        "joined": (two.any(axis=0)[None], (0.25, 0, 1, 0, 0, -1)),
        "duplicate": (np.stack([first, first, second]), (1.0, 0, 0, 1, 0, 1)),
        "nothing": (np.zeros((0, 4, 4, 4), bool), (0.0, 2, 0, 0, 0, -2)),
    }
    for name, (predicted, expected) in cases.items():
        assert tuple(decomposition_scores(predicted, two)) == expected, name
    quarters = [first & (np.indices(first.shape)[1] == y) & (np.indices(first.shape)[0] == x)
                for x in range(2) for y in range(2)]  # fmt: skip
    in_four = decomposition_scores(np.stack([*quarters, second]), two)
    assert (in_four.split, in_four.missing) == (1, 0)
    in_two = decomposition_scores(np.stack([half, first & ~half, second]), two)
    assert (in_two.split, in_two.duplicate) == (0, 1)  # a half has an IoU of 0.5


def test_an_empty_scene_is_decomposed_perfectly_by_nothing():
    nothing = np.zeros((0, 4, 4, 4), bool)
    assert tuple(decomposition_scores(nothing, nothing)) == (1.0, 0, 0, 0, 0, 0)


def test_volumes_of_other_grids_are_refused(two):
    with pytest.raises(InputError, match="on one grid"):
        set_overlaps(two, two[:, 1:])
