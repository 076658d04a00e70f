import numpy as np
import pytest
from plugins.grasping.tests.boxes import box

from scenefw.core.errors import ConfigError
from scenefw_grasping.suction import SuctionCup, frame_along
from scenefw_grasping.surfaces import Surfaces

DOWN = np.array([0.0, 0, -1])


def sealed(item, point, cup, axis=DOWN):
    return cup.seal(Surfaces({1: item}), np.array(point), axis, 1)


def test_a_plane_seals_and_an_edge_does_not():
    cup, item = SuctionCup(radius=0.02), box((0.2, 0.2, 0.1), (0, 0, 0.05))
    assert sealed(item, (0, 0, 0.1), cup) == pytest.approx(1, abs=0.02)
    assert sealed(item, (0.09, 0, 0.1), cup) == 0
    assert sealed(item, (0, 0, 0.1), cup, np.array([0, 0.6, -0.8])) == 0


@pytest.mark.parametrize("radius", [0.05, 0.1, 0.15])
def test_a_sphere_seals_as_its_sagitta_says(radius):
    """The best plane lies between the apex and the rim, weighted by the rings' points."""
    cup = SuctionCup(radius=0.02, give=0.003)
    item = box([2 * radius] * 3, (0, 0, radius), exponent=2)
    heights = -np.array([radius - np.sqrt(radius**2 - r**2) for r in (0.0, 0.01, 0.02)])
    mean = (heights * (1, 8, 16)).sum() / 25
    expected = max(0.0, 1 - np.abs(heights - mean).max() / 0.003)
    assert sealed(item, (0, 0, 2 * radius), cup) == pytest.approx(expected, abs=0.06)


def test_loads_are_limited_by_vacuum_friction_and_rim():
    cup = SuctionCup(radius=0.02, vacuum=50e3, friction=0.5)
    most = np.pi * 0.02**2 * 50e3
    assert cup.force == pytest.approx(most)
    none = np.zeros(3)
    assert cup.holds(np.array([0, 0, 0.99 * most]), none)
    assert not cup.holds(np.array([0, 0, 1.01 * most]), none)
    assert cup.holds(np.array([0.49 * most, 0, 0]), none)
    assert not cup.holds(np.array([0.51 * most, 0, 0]), none)
    assert cup.holds(none, np.array([0, 0.019 * most, 0]))
    assert not cup.holds(none, np.array([0, 0.021 * most, 0]))
    assert not cup.holds(np.array([0, 0, 0.5 * most]), np.array([0.011 * most, 0, 0]))


def test_what_hangs_far_aside_tips_off():
    cup, weight = SuctionCup(), 20.0
    limit = cup.radius * (cup.force - weight) / weight  # of the lever
    above = frame_along(DOWN, np.array([0.0, 0, 0.1]))
    assert cup.carries(above, np.array([0.95 * limit, 0, 0]), weight)
    assert not cup.carries(above, np.array([1.05 * limit, 0, 0]), weight)


def test_the_cup_meets_what_comes_first():
    objects = {4: box((0.1, 0.1, 0.1), (0, 0, 0.05)), 7: box((0.1, 0.1, 0.1), (0.3, 0, 0.05))}
    cup, surfaces = SuctionCup(), Surfaces(objects)
    meeting = cup.meet(surfaces, frame_along(DOWN, np.array([0, 0, 0.08])), 0.1, 0.03)
    assert meeting.label == 4
    assert meeting.distance == pytest.approx(0.08, abs=1e-4)
    assert cup.meet(surfaces, frame_along(DOWN, np.array([0, 0, 0.14])), 0.1, 0.03).label == 0
    assert cup.meet(Surfaces({}), frame_along(DOWN, np.zeros(3)), 0.1, 0.03).label == 0


def test_numbers_must_be_positive():
    with pytest.raises(ConfigError, match="radius = -1"):
        SuctionCup(radius=-1)
