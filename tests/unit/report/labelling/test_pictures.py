"""Pictures of labelled maps."""

import numpy as np
import pytest
from tests.unit.labelling.fakes import CLASSES, truth

from scenefw.core.labels import FROM_BOTH, FROM_MAP, FROM_VIEWS, NO_SOURCE
from scenefw.report.labelling.pictures import (
    SOURCES,
    UNSEEN,
    label_picture,
    map_picture,
    source_picture,
)
from scenefw.report.palette import class_colours


def test_pictures_show_each_vertex_in_its_colour():
    colours = class_colours(3)
    labels = np.array([[0, 2], [-1, 7]])
    picture = label_picture(labels, 3)
    assert picture[0, 1] == pytest.approx(colours[2])
    assert picture[1, 0] == pytest.approx(UNSEEN)
    assert picture[1, 1] == pytest.approx(UNSEEN)
    sources = source_picture(np.array([[NO_SOURCE, FROM_VIEWS, FROM_MAP, FROM_BOTH]], np.uint8))[0]
    expected = [UNSEEN, *(colour for _, colour in SOURCES.values())]
    np.testing.assert_allclose(sources, expected, atol=1e-6)


def test_a_map_of_its_own():
    whole = truth()
    bare = map_picture(whole)
    object.__setattr__(whole, "sources", np.full(whole.labels.shape, FROM_BOTH, np.uint8))
    picture = map_picture(whole)
    assert bare.shape[0] >= 512
    assert picture.shape[2] == 3
    assert picture.min() >= 0
    assert picture.max() <= 1
    assert len(class_colours(len(CLASSES))) == 3
