"""Hypotheses as scenes."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.completion.observed_boxes import observed
from tests.unit.perception.edited_scenes import UPRIGHT
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.perception.synthetic import STACK

from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.types import Pose
from scenefw.perception.estimate.assembly import SceneAssembly
from scenefw.perception.estimate.contacts import overlaps
from scenefw.perception.steps import ObjectSet


@pytest.mark.parametrize("resolution", [32, 64])
def test_a_hypothesis_that_stands_several_times_is_composed_once(resolution):
    objects, geometry = scene_of(resolution)
    one = ObjectSet(objects)
    other = ObjectSet(replace(objects, instances=0 * objects.instances))
    first, second, third = SceneAssembly().volumes([one, other, one], observed(geometry))
    assert third is first
    np.testing.assert_array_equal(first.instances[0].numpy(), objects.instances)
    assert not second.instances.any()


def test_scenes_have_the_origin_and_the_warnings_of_their_view():
    objects, geometry = scene_of(48)
    view = replace(observed(geometry), warnings=("too dark",))
    scenes = list(SceneAssembly(carve=False).assemble([ObjectSet(objects)] * 2, view, {"seed": 5}))
    assert len(scenes) == 2
    for scene in scenes:
        assert scene.details["seed"] == 5
        assert scene.details["warnings"] == ["too dark"]
        assert "floor" not in scene.details  # nobody looked for it
        assert [item.id for item in scene.objects] == [1, 2]
        shown = objects.masks > 0
        assert (scene.masks == objects.masks)[shown].mean() > 0.95


@pytest.mark.parametrize("resolution", [32, 64])
@pytest.mark.parametrize("carve", [True, False])
def test_objects_share_no_space_where_nobody_looks(resolution, carve):
    """The lower box goes on into the upper one, which no pixel contradicts."""
    objects, geometry = scene_of(resolution)
    lower, upper = STACK
    grown = replace(lower, upper=(*lower.upper[:2], lower.upper[2] + 0.02))
    superquadrics = {1: fitted_to(grown), 2: fitted_to(upper)}
    hypothesis = ObjectSet(objects, superquadrics)
    (scene,) = SceneAssembly(carve=carve).assemble([hypothesis], observed(geometry), {})
    assert [item.id for item in scene.objects] == [1, 2]
    assert bool(overlaps(scene.objects)) != carve
    assert [item.placed is None for item in scene.objects].count(True) == carve


def fitted_to(box):
    """A nearly sharp superquadric that fills a box."""
    low, high = np.array(box.lower), np.array(box.upper)
    pose = Pose((low + high) / 2, UPRIGHT)
    return FittedSuperquadric((high - low) / 2, np.full(3, 60.0), pose, 0.0, np.zeros(0))
