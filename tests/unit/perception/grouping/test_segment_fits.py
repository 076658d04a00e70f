"""Superquadrics of segments, against those that the fit finds without a memory."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.evidence.test_gathering import scene_of

from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw.perception.steps import Objects

EVIDENCE = EvidenceGathering(surface_points=60, outside_points=30).of_segments


class Counted:
    """Fits, and counts what it is asked for."""

    def __init__(self):
        self.inner, self.count = SuperquadricFit(rounds=2), 0

    def fit(self, evidence):
        self.count += len(evidence)
        return self.inner.fit(evidence)


def assert_same(found, expected):
    np.testing.assert_allclose(found.half_axes, expected.half_axes, rtol=1e-6)
    np.testing.assert_allclose(found.pose.position, expected.pose.position, atol=1e-7)


@pytest.mark.parametrize("resolution", [32, 64])
def test_fits_are_those_of_the_evidence_about_each_segment(resolution):
    objects, geometry = scene_of(resolution)
    masks = objects.masks
    found = SegmentFits(SuperquadricFit(rounds=2), EVIDENCE).of([2, 1], masks, geometry)
    for label, (shape, evidence) in zip([2, 1], found, strict=True):
        alone = EVIDENCE.of(label, Objects(masks), geometry)
        np.testing.assert_array_equal(evidence.points, alone.points)
        assert_same(shape, SuperquadricFit(rounds=2).fit([alone])[0])


def test_a_group_of_segments_is_fitted_as_one_object():
    objects, geometry = scene_of(32)
    masks = np.where(objects.masks == 2, 3, objects.masks)
    one = np.where(masks > 0, 1, 0).astype(np.int32)
    fits = SegmentFits(SuperquadricFit(rounds=2), EVIDENCE)
    (shape, evidence), (alone, _) = fits.of_groups([{3, 1}, {3}], masks, geometry)
    ((whole, all_of_it),) = fits.of([1], one, geometry)
    np.testing.assert_array_equal(evidence.points, all_of_it.points)
    assert_same(shape, whole)
    assert not np.allclose(alone.half_axes, whole.half_axes, rtol=0.01)


def test_a_set_of_pixels_is_fitted_once_whatever_its_label():
    objects, geometry = scene_of(32)
    counted = Counted()
    fits = SegmentFits(counted, EVIDENCE)
    first = fits.of([1, 2], objects.masks, geometry)
    assert counted.count == 2
    again = fits.of([2, 7], np.where(objects.masks == 1, 7, objects.masks), geometry)
    assert counted.count == 2
    assert [shape for shape, _ in again] == [shape for shape, _ in first[::-1]]
    fits.of([1], np.where(objects.masks == 2, 0, objects.masks), geometry)  # no neighbour
    assert counted.count == 3


def test_fits_are_forgotten_with_their_view():
    objects, geometry = scene_of(32)
    counted = Counted()
    fits = SegmentFits(counted, EVIDENCE)
    other = replace(geometry, points=geometry.points.copy())
    for view, count in ((geometry, 1), (geometry, 1), (other, 2), (other, 2), (geometry, 3)):
        fits.of([1], objects.masks, view)
        assert counted.count == count
