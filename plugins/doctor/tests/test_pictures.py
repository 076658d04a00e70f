import numpy as np
import pytest
from plugins.doctor.tests.test_examination import EXAMINER, FRAME
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw_doctor.pictures import draw_examination


def hue(picture, where):
    return picture[where].mean(axis=0)


def test_floor_is_green_and_objects_are_orange():
    picture = draw_examination(EXAMINER.examine(FRAME), GridSpec())
    assert picture.shape[1] == 2 * 160 + 6
    tinted = picture[-126:-6, :160]  # the lower left tile
    red, green, blue = hue(tinted, (FRAME.labels == 0) & (FRAME.depth > 0))
    assert green > red + 0.1
    assert green > blue
    red, green, blue = hue(tinted, FRAME.labels == 2)
    assert red > green > blue + 0.1
    above = picture[-126:-6, 166:]
    dark = (np.abs(above - 0.3) < 0.02).all(axis=-1)
    assert dark.sum(axis=0).max() > 60  # a side of the cube, 1 m of 1.6 m


@pytest.mark.parametrize("boxes", [(), None])
def test_what_is_known_is_drawn(boxes):
    if boxes is None:
        frame = frame_of(camera_at((0, 0, 1), (0, 5, 1.0), size=(160, 120)), table=None)
    else:
        frame = frame_of(camera_at(size=(160, 120)), boxes)
    found = EXAMINER.examine(frame)
    assert found.usable == (boxes is not None)  # a bare table can be predicted, a wall can't
    height = draw_examination(found, GridSpec()).shape[0]
    assert (height > 2 * 120) == (found.floor is not None)
