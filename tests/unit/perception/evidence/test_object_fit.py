"""Which objects are fitted, and by what."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.completion.observed_boxes import observed
from tests.unit.perception.evidence.test_gathering import distance, scene_of
from tests.unit.perception.synthetic import STACK
from tests.unit.perception.usual_fits import object_fit

from scenefw.core.batches import PartialTSDF
from scenefw.core.errors import ConfigError, InputError
from scenefw.fitting.placed import shape_of
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.points import MIN_POINTS
from scenefw.perception.steps import Objects


@pytest.mark.parametrize("resolution", [32, 64])
def test_each_object_has_evidence_and_a_superquadric(resolution):
    objects, geometry = scene_of(resolution)
    fits = object_fit().fit(objects, geometry)
    assert fits.objects is objects
    assert list(fits.evidence) == list(fits.superquadrics) == [1, 2]
    for label, box in enumerate(STACK, start=1):
        evidence, one = fits.evidence[label], fits.superquadrics[label]
        assert len(one.distances) == len(evidence.points)
        assert np.abs(distance(evidence.points[evidence.visible], box)).max() < 1e-5
        corners = shape_of(one).mesh(8).vertices @ one.pose.rotation.T + one.pose.position
        assert np.abs(distance(corners, box)).max() < 0.02


@pytest.mark.parametrize("resolution", [48, 64])
def test_without_masks_a_pixel_shows_the_volume_that_its_point_lies_in(resolution):
    objects, geometry = scene_of(resolution)
    fits = object_fit().fit(replace(objects, masks=None), geometry)
    shown = objects.masks > 0
    assert (fits.objects.masks[shown] == objects.masks[shown]).mean() > 0.95
    assert set(fits.superquadrics) == {1, 2}
    with pytest.raises(InputError, match="doesn't say which pixels"):
        object_fit().fit(Objects(None), geometry)


def test_masks_without_a_volume_are_objects_if_they_stand_in_the_grid():
    objects, geometry = scene_of(64)
    flat = Objects(objects.masks)
    assert set(object_fit().fit(flat, geometry).superquadrics) == {1, 2}
    high = object_fit(min_height=0.15)
    assert set(high.fit(flat, geometry).superquadrics) == {2}  # the other one is 12 cm high
    assert set(high.fit(objects, geometry).superquadrics) == {1, 2}  # they have volumes
    away = replace(geometry, points=geometry.points + (0.0, 2.0, 0.0))
    assert object_fit().fit(flat, away).superquadrics == {}


def test_objects_of_which_too_little_is_visible_are_not_fitted():
    objects, geometry = scene_of(32)
    others = np.where(objects.masks == 2, 0, objects.masks)
    for count, fitted in ((MIN_POINTS, {1, 2}), (MIN_POINTS - 1, {1})):
        masks = others.copy()
        masks.ravel()[np.flatnonzero(objects.masks == 2)[:count]] = 2
        fits = object_fit().fit(replace(objects, masks=masks), geometry)
        assert set(fits.superquadrics) == set(fits.evidence) == fitted
    none = replace(objects, masks=np.zeros_like(others))
    assert object_fit().fit(none, geometry).superquadrics == {}


def test_a_view_without_its_image_is_told():
    objects, geometry = scene_of(32)
    partial = observed(geometry).partial
    blind = Observation.of_partial(PartialTSDF(partial.distance, partial.observed), geometry.grid)
    with pytest.raises(InputError, match="needs the depth images"):
        object_fit().fit(objects, blind)


def test_wrong_numbers_are_refused():
    with pytest.raises(ConfigError, match=r"^min_height = "):
        object_fit(min_height=-0.01)
