"""Agreement of two labellings, and the plane through a table."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scenefw_labelling_studies.repeatability import (
    agreement,
    chance_agreement,
    mutual_iou,
    plane_through,
)

CLASSES = 4
LABELS = arrays(np.int32, 40, elements=st.integers(-1, CLASSES - 1))


@given(LABELS, LABELS)
def test_agreement_is_counted_where_both_are_labelled(first, second):
    pairs = [(a, b) for a, b in zip(first, second, strict=True) if a >= 0 and b >= 0]
    assume(pairs)
    assert agreement(first, second) == pytest.approx(np.mean([a == b for a, b in pairs]))
    every = [a == b for a, _ in pairs for _, b in pairs]  # labels of one place by those of another
    assert chance_agreement(first, second, CLASSES) == pytest.approx(np.mean(every))


@given(LABELS, LABELS)
def test_iou_of_two_labellings_is_that_of_sets_of_places(first, second):
    known = (first >= 0) & (second >= 0)
    assume(known.any())
    ious = []
    for label in range(CLASSES):
        one, other = ({*np.flatnonzero(known & (x == label))} for x in (first, second))
        if one | other:
            ious.append(len(one & other) / len(one | other))
    assert mutual_iou(first, second, CLASSES) == pytest.approx(np.mean(ious))
    assert mutual_iou(second, first, CLASSES) == mutual_iou(first, second, CLASSES)


def test_nothing_in_common_has_no_agreement():
    nothing, some = np.full(3, -1), np.zeros(3, int)
    assert np.isnan(agreement(nothing, some))
    assert np.isnan(chance_agreement(nothing, some, CLASSES))
    assert np.isnan(mutual_iou(nothing, some, CLASSES))


@pytest.mark.parametrize("count", [400, 6400])
@pytest.mark.parametrize("tilt", [0.0, 2.0])
def test_a_rough_tilted_table_with_things_on_it(count, tilt):
    random = np.random.default_rng(0)
    places = random.uniform(-0.5, 0.5, (count, 2))
    heights = places[:, 0] * np.tan(np.radians(tilt)) + random.normal(0, 1e-3, count)
    heights[: count // 10] += 0.05
    found, roughness = plane_through(places, heights)
    assert found == pytest.approx(tilt, abs=0.1)
    assert roughness == pytest.approx(1e-3, rel=0.15)
