"""Pixels that lie on another object's superquadric go to it."""

import numpy as np
import pytest
from tests.unit.perception.evidence.test_gathering import scene_of

from scenefw.core.errors import ConfigError
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw_decomposing.reassignment import ResidualReassignment


def dealt(**settings):
    return ResidualReassignment(SegmentFits(SuperquadricFit(), EvidenceGathering()), **settings)


@pytest.fixture(scope="module")
def boxes():
    """What a view of two boxes says, and their true masks."""
    objects, geometry = scene_of(48)
    return geometry, objects.masks


def objects_of(boxes, masks, **settings):
    return dealt(**settings).reassign(masks.astype(np.int32), boxes[0])


def test_true_masks_stay(boxes):
    true = boxes[1]
    found = objects_of(boxes, true)
    assert (found == true)[true > 0].mean() > 0.995
    assert not found[true == 0].any()


def test_a_strip_of_another_object_goes_back(boxes):
    true = boxes[1]
    columns = np.nonzero(true == 2)[1]
    strip = (true == 2) & (np.arange(true.shape[1]) < np.quantile(columns, 0.1))
    wrong = np.where(strip, 1, true)
    assert strip.sum() > 20
    found = objects_of(boxes, wrong)
    assert (found == 2)[strip].mean() > 0.9
    assert (found == true)[(true > 0) & ~strip].mean() > 0.99


def test_what_its_own_superquadric_does_not_explain_keeps_its_pixels(boxes):
    """A strip of the second box in the mask of the first, whose box explains nearly all of it."""
    true = boxes[1]
    columns = np.nonzero(true == 2)[1]
    strip = (true == 2) & (np.arange(true.shape[1]) < np.quantile(columns, 0.1))
    wrong = np.where(strip, 1, true)
    assert (objects_of(boxes, wrong, min_inlier_ratio=0.5) == 2)[strip].mean() > 0.9
    assert (objects_of(boxes, wrong, min_inlier_ratio=0.999) == 1)[strip].all()


def test_a_part_that_two_others_explain_is_given_up(boxes):
    true = boxes[1]
    generator = np.random.default_rng(0)
    taken = (true > 0) & (generator.random(true.shape) < 0.3)
    found = objects_of(boxes, np.where(taken, 3, true))
    assert set(np.unique(found)) == {0, 1, 2}
    assert (found == true)[true > 0].mean() > 0.99


@pytest.mark.parametrize("count", [1, 3, 29])
def test_specks_stay_as_they_are(boxes, count):
    """Nothing can be fitted to one pixel."""
    true = boxes[1]
    rows, columns = np.nonzero(true == 1)
    speck = true.copy()
    speck[rows[:count], columns[:count]] = 7
    found = objects_of(boxes, speck)
    assert (found == 7).sum() == count
    nothing = np.where(speck == 7, 7, 0)
    np.testing.assert_array_equal(objects_of(boxes, nothing), nothing)


@pytest.mark.parametrize(
    "wrong",
    [
        {"inlier_distance": 0.0},
        {"min_explained_ratio": 0.0},
        {"min_inlier_ratio": 1.5},
        {"min_pixels": 3},
    ],
)
def test_bad_settings(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        dealt(**wrong)
