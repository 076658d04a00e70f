"""Hypotheses by evidence and by how far their objects move."""

from dataclasses import replace

import pytest
from plugins.simulators.tests.test_settling import HALF, estimate

from scenefw.core.errors import ConfigError
from scenefw.core.types import TriangleMesh
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_single_view_benchmarks.stability_ranking import StabilityRanking

STANDS = (0.2, 0, HALF), (-0.1, 0, HALF)
FALLS = (0.2, 0, HALF), (-0.1, 0, HALF + 0.05)
FALLS_FAR = (0.2, 0, HALF), (-0.1, 0, HALF + 0.3)


class Told:
    """Says the deviations of scenes in their order, and sorts nothing."""

    def __init__(self, *deviations):
        self.deviations = deviations

    def rank(self, scenes):
        return [
            replace(one, details={**one.details, "evidence": {"deviation": each, "hypothesis": k}})
            for k, (one, each) in enumerate(zip(scenes, self.deviations, strict=True), 1)
        ]


def order(ranking, *piles):
    found = ranking.rank([estimate(*pile) for pile in piles])
    return [one.details["evidence"]["hypothesis"] for one in found], found


def by(*deviations, **settings):
    return StabilityRanking(Told(*deviations), PyBulletEngine(), BodyMaker(), **settings)


def test_of_equally_explained_scenes_the_one_that_stands_comes_first():
    numbers, found = order(by(1.0, 1.0, 1.0, 1.0), FALLS, FALLS_FAR, STANDS, FALLS)
    assert numbers == [1, 3, 4, 2]  # the first stays the first
    moved = [one.details["stability"]["displacement"] for one in found]
    assert moved[1] == pytest.approx(0.0, abs=3e-3)
    assert moved[2] == pytest.approx(0.025, abs=3e-3)  # the mean of both objects
    assert moved[3] == pytest.approx(0.1, abs=3e-3)  # 20 cm at most
    assert found[0].details["seed"] == 7


def test_evidence_counts_as_much_as_its_unit_says():
    """2.5 cm more of displacement weigh as much as 0.5 deviations with a unit of 5 cm."""
    assert order(by(1, 1.6, 1.0, unit=0.05), STANDS, STANDS, FALLS)[0] == [1, 3, 2]
    assert order(by(1, 1.4, 1.0, unit=0.05), STANDS, STANDS, FALLS)[0] == [1, 2, 3]
    assert order(by(1, 1.4, 1.0, unit=0.1), STANDS, STANDS, FALLS)[0] == [1, 3, 2]


def test_scenes_of_nothing_come_last():
    numbers, found = order(by(1.0, None, 2.0), STANDS, (), FALLS)
    assert numbers == [1, 3, 2]
    assert found[2].details["stability"] == {"displacement": None, "left_out": 0}
    assert by().rank([]) == []


def test_what_is_no_solid_counts_as_far():
    pile = estimate(*STANDS)
    mesh = pile.objects[0].mesh
    opened = replace(pile.objects[0], mesh=TriangleMesh(mesh.vertices, mesh.faces[1:]))
    opened = replace(pile, objects=(opened, pile.objects[1]))
    found = by(1, 1, 1).rank([pile, opened, pile])
    assert [one.details["stability"]["left_out"] for one in found] == [0, 0, 1]
    assert found[2].details["stability"]["displacement"] == pytest.approx(0.1, abs=3e-3)


def test_scenes_stay_as_they_are():
    before = estimate(*FALLS)
    (after,) = by(1.0).rank([before])
    assert after.objects == before.objects
    assert after.tsdf is before.tsdf


@pytest.mark.parametrize("wrong", [{"unit": 0.0}, {"max_displacement": -1.0}, {"steps": 0}])
def test_numbers_that_mean_nothing_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))) as caught:
        by(**wrong)
    assert "\n" not in str(caught.value)
