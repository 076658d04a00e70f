"""Objects that someone has marked are the segments."""

import numpy as np
import pytest
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation.marked import MarkedObjects

FRAME = frame_of(camera_at(size=(160, 120)))


def test_marks_are_the_segments():
    marks = np.where(FRAME.labels == 2, 7, 0).astype(np.int32)
    assert MarkedObjects().segment(Observation(FRAME, masks=marks)) is marks


def test_an_image_without_marks_is_refused():
    with pytest.raises(InputError, match="no objects are marked"):
        MarkedObjects().segment(Observation(FRAME))
