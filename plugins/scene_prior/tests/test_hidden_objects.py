"""Objects of which nothing is visible, in further hypotheses."""

import numpy as np
import pytest
from tests.unit.perception.completion.test_extent_sampling import (
    Loaded,
    Told,
    _in_view_frame,
    boxes_that_end_at,
    fronts,
    method,
    sampled,
)

from scenefw.core.errors import ConfigError
from scenefw_scene_prior.hidden_objects import HiddenObjects


def with_hidden(scene, *places):
    """Draws beside the best scene: one small box at each place, in one try after the other."""
    small = [0.01, 0.01, 0.01]
    told = boxes_that_end_at(scene, 0.06)
    tries = [[*told, [_in_view_frame(scene, np.array(place)), small]] for place in places]
    model = Told(tries)
    hidden = HiddenObjects(Loaded(model), tries=len(tries))
    best, drawn = sampled(method([told], hidden=hidden), scene, 2)
    return best, [one for label, one in drawn.items() if label not in best], model.known


def behind(scene):
    """A place on the floor that the lower box hides."""
    objects, view = scene
    place = view.eye + 1.25 * (view.points[objects.masks == 1].mean(axis=0) - view.eye)
    place[2] = 0.02
    assert not view.free[tuple(np.rint(view.grid.to_voxels(place)).astype(int))]
    return place


def test_hidden_objects_appear_where_nothing_is_seen_alone():
    scene = fronts()
    place = behind(scene)
    in_the_air, outside = (0.0, -0.3, 0.5), (0.0, 0.9, 0.02)
    best, hidden, known = with_hidden(scene, in_the_air, outside, place)
    assert np.allclose([one.pose.position for one in hidden], [place], atol=0.005)
    assert np.allclose(known.half_axes[0].numpy(), [best[k].half_axes for k in (1, 2)], atol=0.02)
    assert not with_hidden(scene, in_the_air, outside)[1]
    inside = best[1].pose.position
    assert not with_hidden(scene, inside)[1]


def test_where_there_is_no_room_for_two_hidden_objects_there_is_one():
    scene = fronts()
    small, told = [0.01, 0.01, 0.01], boxes_that_end_at(scene, 0.06)
    places = [_in_view_frame(scene, np.array(place)) for place in (behind(scene), (0.0, -0.3, 0.5))]
    model = Told([[*told, *[[place, small] for place in places]]])
    for model.hidden, count in ((2, 1), (0, 0)):
        hidden = HiddenObjects(Loaded(model), tries=2)
        best, drawn = sampled(method([told], hidden=hidden), scene, 2)
        assert len(drawn) - len(best) == count


def test_networks_that_draw_nothing_hidden_are_refused():
    model = Told([])
    model.draws_hidden = False
    with pytest.raises(ConfigError, match=r"checkpoints\.set_flow=FILE"):
        HiddenObjects(Loaded(model))
    with pytest.raises(ConfigError, match="tries 0"):
        HiddenObjects(Loaded(Told([])), tries=0)
