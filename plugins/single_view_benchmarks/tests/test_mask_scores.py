"""Mask measures against hand-computed cases and a pixel-by-pixel reference."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import InputError
from scenefw_single_view_benchmarks.mask_scores import borders, mask_scores


def _image(*boxes, shape=(40, 60)):
    labels = np.zeros(shape, np.int32)
    for label, (top, left, bottom, right) in enumerate(boxes, start=1):
        labels[top:bottom, left:right] = label
    return labels


def test_perfect_prediction_whatever_the_numbers():
    true = _image((5, 5, 15, 20), (20, 30, 30, 50))
    scores = mask_scores(np.where(true > 0, 10 - true, 0), true)
    assert (scores.overlap_f, scores.boundary_f, scores.objects_f75) == (1, 1, 1)
    assert (scores.predicted, scores.true, scores.count_error) == (2, 2, 0)


def test_overlap_by_hand():
    true = _image((0, 0, 10, 10), (0, 20, 10, 30))
    predicted = _image((0, 0, 10, 8), (0, 20, 10, 40), (30, 30, 40, 40))
    scores = mask_scores(predicted, true)
    # matched: 80 of 100, and 100 of 100; predicted pixels 80 + 200 + 100, true pixels 200
    assert scores.overlap_precision == pytest.approx(180 / 380)
    assert scores.overlap_recall == pytest.approx(180 / 200)
    assert scores.overlap_f == pytest.approx(2 * 180 / 580)
    assert scores.objects_f75 == 0.5  # F = 160/180 and 200/300
    assert scores.count_error == 1


def test_joined_objects_are_matched_once():
    true = _image((0, 0, 10, 10), (0, 10, 10, 20))
    scores = mask_scores((true > 0).astype(np.int32), true)
    assert scores.overlap_precision == scores.overlap_recall == 0.5
    assert scores.objects_f75 == 0


def test_unknown_pixels_count_for_nothing():
    true = _image((0, 0, 10, 10))
    predicted = _image((0, 0, 10, 20))
    true[:, 10:20] = -1
    assert mask_scores(predicted, true).overlap_f == 1
    assert mask_scores(predicted, np.maximum(true, 0)).overlap_f < 1


@pytest.mark.parametrize(
    ("predicted", "true", "expected"),
    [
        ([], [(0, 0, 9, 9)], (1, 0, 0, 1, 0, 0, 0, 0, 1)),
        ([(0, 0, 9, 9)], [], (0, 1, 0, 0, 1, 0, 0, 1, 0)),
        ([], [], (1, 1, 1, 1, 1, 1, 1, 0, 0)),
    ],
)
def test_published_conventions_for_empty_images(predicted, true, expected):
    scores = mask_scores(_image(*predicted), _image(*true))
    assert tuple(vars(scores).values()) == expected


def test_border_of_a_box():
    mask = _image((2, 3, 5, 7), shape=(8, 10)) > 0
    line = borders(mask)
    assert line.sum() == 2 * (3 + 4)  # a closed line round 3 x 4 pixels
    assert line[1, 2:7].all()
    assert line[1:5, 2].all()
    assert not line[2:4, 3:6].any()


def test_borders_match_within_the_tolerance_only():
    true = _image((10, 10, 30, 30), shape=(480, 640))  # 800 px diagonal: 3 px
    near = mask_scores(np.roll(true, 3, axis=1), true)
    far = mask_scores(np.roll(true, 4, axis=1), true)
    assert near.boundary_f == 1
    assert far.boundary_f < 0.7


def test_sizes_must_agree():
    with pytest.raises(InputError, match=r"\(40, 60\).*\(4, 4\)"):
        mask_scores(_image(), _image(shape=(4, 4)))


def _reference(predicted, true, tolerance):
    """The definition read aloud: loops over pixels, and all assignments tried."""
    h, w = true.shape
    radius = math.ceil(tolerance * math.hypot(h, w))

    def pixels(labels, i):
        return {(y, x) for y in range(h) for x in range(w) if labels[y, x] == i and true[y, x] >= 0}

    def border(mask):
        line = set()
        for y, x in itertools.product(range(h), range(w)):
            y1, x1 = min(y + 1, h - 1), min(x + 1, w - 1)
            if len({p in mask for p in ((y, x), (y1, x), (y, x1), (y1, x1))}) > 1:
                line.add((y, x))
        return line

    def near(line, other):
        return sum(any(math.dist(p, q) <= radius for q in other) for p in line)

    ours = [pixels(predicted, i) for i in np.unique(predicted) if i > 0]
    theirs = [pixels(true, i) for i in np.unique(true) if i > 0]
    ours = [m for m in ours if m]
    f = [[2 * len(a & b) / (len(a) + len(b)) for b in theirs] for a in ours]
    padded = range(max(len(ours), len(theirs)))
    matchings = [
        [(i, j) for i, j in enumerate(order) if i < len(ours) and j < len(theirs) and f[i][j] > 0]
        for order in itertools.permutations(padded)
    ]
    totals = [sum(f[i][j] for i, j in pairs) for pairs in matchings]
    a, b = [border(m) for m in ours], [border(m) for m in theirs]
    for pairs, total in zip(matchings, totals, strict=True):
        if total < max(totals) - 1e-9:
            continue
        common = sum(len(ours[i] & theirs[j]) for i, j in pairs)
        yield {
            "overlap_precision": common / sum(map(len, ours)),
            "overlap_recall": common / sum(map(len, theirs)),
            "boundary_precision": sum(near(a[i], b[j]) for i, j in pairs) / sum(map(len, a)),
            "boundary_recall": sum(near(b[j], a[i]) for i, j in pairs) / sum(map(len, b)),
            "objects_f75": sum(f[i][j] >= 0.75 for i, j in pairs) / len(theirs),
        }


@given(seed=st.integers(0, 10_000), tolerance=st.sampled_from([0.003, 0.1]))
def test_against_brute_force(seed, tolerance):
    rng = np.random.default_rng(seed)
    shape = (12, 15)

    def scene():
        labels = np.zeros(shape, np.int32)
        for label in range(1, 4):
            top, left = rng.integers(0, 9, 2)
            labels[top : top + rng.integers(2, 8), left : left + rng.integers(2, 8)] = label
        return labels

    true, predicted = scene(), scene()
    true[:2, :2] = -1
    if not (true > 0).any() or not ((predicted > 0) & (true >= 0)).any():
        return
    ours = vars(mask_scores(predicted, true, tolerance))
    best = list(_reference(predicted, true, tolerance))  # several where matchings tie
    assert any(all(ours[n] == pytest.approx(v) for n, v in one.items()) for one in best)
