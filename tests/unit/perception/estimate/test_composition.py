"""Volumes of superquadrics among rough volumes."""

import numpy as np
import pytest
import torch
from tests.unit.perception.completion.observed_boxes import observed
from tests.unit.perception.evidence.test_gathering import distance, scene_of
from tests.unit.perception.synthetic import STACK
from tests.unit.perception.usual_fits import object_fit

from scenefw.perception.estimate.composition import composed, with_superquadrics
from scenefw.perception.steps import Objects, ObjectSet


@pytest.mark.parametrize("label", [1, 2])
def test_one_sharp_object_beside_one_that_stays(label):
    objects, geometry = scene_of(64)
    sharp = object_fit().fit(objects, geometry).superquadrics[label]
    tsdf, instances = with_superquadrics(objects, {label: sharp}, geometry.grid)
    other = 3 - label
    kept = (instances == other).sum() / (objects.instances == other).sum()
    assert 0.8 < kept <= 1
    assert ((instances > 0) == (tsdf < 0)).all()
    inside = distance(geometry.grid.centres(), STACK[label - 1]) < -0.01
    assert (instances[inside] == label).mean() > 0.85


@pytest.mark.parametrize("resolution", [32, 64])
def test_a_hypothesis_without_superquadrics_is_its_volumes(resolution):
    objects, geometry = scene_of(resolution)
    further = {"mine": torch.ones(1, 1, *geometry.grid.shape)}
    rough = Objects(None, objects.tsdf, objects.instances, further)
    scene = composed(ObjectSet(rough), observed(geometry))
    np.testing.assert_array_equal(scene.tsdf[0].numpy(), objects.tsdf)
    np.testing.assert_array_equal(scene.instances[0].numpy(), objects.instances)
    assert scene.volumes["mine"] is further["mine"]
    assert scene.masks is None
    assert scene.placed == ()


def test_no_superquadric_is_an_empty_scene_where_there_is_no_volume():
    objects, geometry = scene_of(32)
    scene = composed(ObjectSet(Objects(objects.masks), {}), observed(geometry))
    assert (scene.tsdf == geometry.grid.truncation).all()
    assert not scene.instances.any()
    assert scene.placed == ({},)


def test_a_hypothesis_of_nothing_is_an_error():
    objects, geometry = scene_of(32)
    with pytest.raises(TypeError, match="superquadrics or volumes"):
        composed(ObjectSet(Objects(objects.masks)), observed(geometry))
