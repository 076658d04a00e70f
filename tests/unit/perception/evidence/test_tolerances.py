"""Which superquadrics explain what is visible of an object."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.completion.test_support import box
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.perception.usual_fits import TOLERANCES

from scenefw.core.errors import ConfigError
from scenefw.core.evidence import Evidence

SHAPE = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.1))


@pytest.mark.parametrize("missed", [0, 24, 26, 100])
def test_only_visible_points_say_whether_a_shape_explains_an_object(missed):
    """100 points are visible, and as many far-away ones are guesses."""
    _, geometry = scene_of(32)
    closed = replace(geometry, free=np.zeros_like(geometry.free))
    evidence = Evidence(np.zeros((200, 3)), np.repeat([0.003, 0.1], 100))
    distances = np.repeat([0.005, 1.0], 100)
    distances[:missed] = -0.007
    shape = replace(SHAPE, distances=distances)
    assert TOLERANCES.accept(shape, evidence, closed) == (missed <= 25)


@pytest.mark.parametrize("resolution", [32, 64])
@pytest.mark.parametrize("end", [0.02, 0.2])
def test_a_shape_in_free_space_is_none(resolution, end):
    """Beyond a height everything is free; the voxels at the border of that may be either."""
    _, geometry = scene_of(resolution)
    geometry = replace(geometry, free=geometry.grid.centres()[..., 2] > end)
    evidence = Evidence(np.zeros((1, 3)), np.full(1, 0.003))
    shape = replace(SHAPE, distances=np.zeros(1))
    assert TOLERANCES.accept(shape, evidence, geometry) == (end > 0.1)
    assert replace(TOLERANCES, max_free_ratio=1.0).accept(shape, evidence, geometry)


@pytest.mark.parametrize(
    "wrong",
    [
        {"inlier_distance": 0.0},
        {"min_inlier_ratio": 1.5},
        {"max_free_ratio": -0.1},
        {"point_sigma": 0.0},
        {"floor_margin": -0.01},
        {"outside_sigma": 0.0},
    ],
)
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=f"^{next(iter(wrong))} = "):
        replace(TOLERANCES, **wrong)
