"""Parts cut in two where two boxes touch without a step between them."""

import numpy as np
import pytest
from tests.unit.perception.grouping.test_merging import merging, seen
from tests.unit.perception.synthetic import Box

from scenefw.core.errors import ConfigError
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw.perception.grouping.splitting import FitSplitting

BELOW = Box((-0.16, -0.1, 0.0), (0.16, 0.1, 0.08))
ABOVE = Box((-0.1, -0.1, 0.08), (-0.02, -0.02, 0.24))
ALONE = Box((0.3, -0.1, 0.0), (0.45, 0.05, 0.1))


def split(**changes):
    return FitSplitting(SegmentFits(SuperquadricFit(), EvidenceGathering()), **changes)


def overlap(found, true):
    """Least IoU of a true object's pixels with the part that most of them have."""
    ious = []
    for label in np.unique(true[true > 0]):
        own = true == label
        part = np.bincount(found[own]).argmax()
        ious.append((own & (found == part)).sum() / (own | (found == part)).sum())
    return min(ious)


@pytest.mark.parametrize("resolution", [32, 64])
def test_two_boxes_in_one_part_are_cut_where_they_touch(resolution):
    geometry, labels, depth = seen((BELOW, ABOVE, ALONE), resolution)
    parts = np.where(labels == 2, 1, labels).astype(np.int32)
    found = split().split(parts, geometry)
    assert overlap(found, labels) > 0.9 > overlap(parts, labels)
    assert ((found > 0) == (parts > 0)).all()
    assert len(np.unique(found)) == len(np.unique(labels))
    joined = merging().merge(found, geometry, depth)
    assert overlap(joined, labels) > 0.9


def test_what_one_superquadric_explains_stays_whole():
    geometry, labels, _ = seen((BELOW, ALONE))
    np.testing.assert_array_equal(split().split(labels, geometry), labels)


def test_a_cut_that_saves_too_little_is_not_made():
    geometry, labels, _ = seen((BELOW, ABOVE))
    parts = (labels > 0).astype(np.int32)
    np.testing.assert_array_equal(split(min_gain=1e9).split(parts, geometry), parts)
    np.testing.assert_array_equal(split(max_deviation=1e-9).split(parts, geometry), parts)


def test_an_image_without_parts():
    geometry, labels, _ = seen((BELOW,))
    assert not split().split(np.zeros_like(labels), geometry).any()


def test_numbers_are_checked():
    with pytest.raises(ConfigError, match=r"^min_gain = 0\.0"):
        split(min_gain=0.0)
