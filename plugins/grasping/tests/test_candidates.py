import numpy as np
import pytest
from plugins.grasping.tests.boxes import EYE, box

from scenefw.core.errors import ConfigError
from scenefw_grasping.candidates import SuctionCandidates
from scenefw_grasping.suction import SuctionCup


def found(objects, eye=EYE, **changes):
    return SuctionCandidates(SuctionCup(), points=80, **changes).find(objects, np.array(eye))


def test_contacts_lie_on_seen_sides_and_look_outward():
    item = box((0.16, 0.16, 0.16), (0, 0, 0.08))
    (grasps,) = found({5: item}).values()
    assert {grasp.label for grasp in grasps} == {5}
    for grasp in grasps:
        local = (grasp.point - item.pose.position) / 0.08
        side = np.abs(local).argmax()
        assert abs(local[side]) == pytest.approx(1, abs=0.02)
        assert grasp.normal[side] * np.sign(local[side]) > 0.98
        assert (EYE - grasp.point) @ grasp.normal > 0
        assert grasp.seen
        assert grasp.seal > 0.5
    ways = {(bool(grasp.normal[2] > 0.9), grasp.outward) for grasp in grasps}
    assert ways == {(True, False), (False, False), (False, True)}


def test_what_the_camera_did_not_see_is_used_on_demand():
    item = {1: box((0.16, 0.16, 0.16), (0, 0, 0.08))}
    away = [grasp for grasp in found(item, hidden=True)[1] if grasp.normal[1] > 0.9]
    assert away
    assert not any(grasp.seen for grasp in away)
    again = [grasp.point.tolist() for grasp in found(item, hidden=True)[1]]
    assert again == [grasp.point.tolist() for grasp in found(item, hidden=True)[1]]


def test_an_object_without_contacts_has_a_reason():
    heavy, small = box((0.2, 0.2, 0.2), (0, 0, 0.1), 8.0), box((0.03, 0.03, 0.03), (0.3, 0, 0.015))
    long = box((0.5, 0.1, 0.1), (0, 0.4, 0.05), 1.0)
    reasons = found({1: heavy, 2: small, 3: long}, steepest=10.0)
    assert "too heavy: about 8.0 kg, at most 3.0 kg" in reasons[1]
    assert reasons[2] == "it is nowhere flat enough for a cup of 4 cm"
    assert all(abs(grasp.point[0]) < 0.11 for grasp in reasons[3])  # else it tips off


def test_numbers_must_be_positive():
    with pytest.raises(ConfigError, match="payload = 0"):
        SuctionCandidates(SuctionCup(), payload=0)
