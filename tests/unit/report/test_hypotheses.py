from dataclasses import replace

import numpy as np
import pytest
from tests.unit.report.test_overview import estimate_of
from tests.unit.report.test_pictures import _has_hue

from scenefw.report.hypotheses import draw_hypotheses
from scenefw.report.palette import instance_colours
from scenefw.report.solids import solids_of
from scenefw.report.window import two_views


@pytest.mark.exhaustive
def test_each_scene_has_a_column_with_its_objects_in_their_colours():
    one = estimate_of(resolution=32)
    second = np.where(one.instances > 0, 2, 0).astype(np.int32)
    renamed = tuple(replace(item, id=2) for item in one.objects)
    other = replace(one, instances=second, objects=renamed)
    scenes = [one, other, one]
    solids = solids_of(scenes)
    picture = draw_hypotheses(scenes, solids, two_views(solids[0], one))
    assert picture.shape[1] == 3 * 400 + 2 * 6
    columns = [picture[:, left : left + 400] for left in (0, 406, 812)]
    first_hue, second_hue = instance_colours(2)
    assert [_has_hue(column, first_hue) > 1000 for column in columns] == [True, False, True]
    assert [_has_hue(column, second_hue) > 1000 for column in columns] == [False, True, False]
