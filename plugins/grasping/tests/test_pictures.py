"""Ranked grasps: the table, and marks that objects hide."""

import numpy as np
import pytest

from scenefw.core.geometry import look_at, rigid
from scenefw.core.types import Camera
from scenefw_grasping.grasps import Grasp, Lift, RankedGrasp, Ranking
from scenefw_grasping.report.pictures import grasp_table, mark_grasps

GREEN = (np.array([0, 140, 70]) / 255).astype(np.float32)


def test_a_table_says_why_an_object_has_no_grasp():
    grasp = Grasp(4, rigid(np.diag([1.0, -1, -1]), (0.1, 0.2, 0.3)), seal=0.5)
    lift = Lift(4, "", {1: 0.002, 2: 0.004})
    table = grasp_table(Ranking((RankedGrasp(grasp, grasp, lift),), {1: "it is too heavy"}, {}))
    ((name, cells),) = table.rows
    assert (name, cells[0]) == ("1", "4")
    assert cells[1] == pytest.approx(3)
    assert cells[2:] == ("yes", "up", 50, "10.0, 20.0, 30.0")
    assert table.note == "object 1 has none: it is too heavy"


def test_a_reason_that_holds_for_several_objects_is_said_once():
    reasons = {1: "it is round", 2: "it is too heavy", 3: "it is round", 5: "it is round"}
    assert grasp_table(Ranking((), reasons, {})).note == (
        "objects 1, 3 and 5 have none: it is round; object 2 has none: it is too heavy"
    )


def marked(contact, wall):
    """Pixels of the marks of a grasp from above, with a wall so far away (m) in the left half."""
    camera = Camera(120, 90, 100.0, 100.0, 59.5, 44.5, look_at((0, -1, 0.3), (0, 0, 0.1)))
    grasp = Grasp(1, rigid(np.diag([1.0, -1, -1]), contact), seal=1.0)
    ranking = Ranking((RankedGrasp(grasp, grasp, Lift(1, "", {})),), {}, {})
    depth = np.full((90, 120), 3, np.float32)
    depth[:, :60] = wall
    picture = mark_grasps(np.ones((90, 120, 3), np.float32), ranking, camera, depth)
    return np.abs(picture - GREEN).max(axis=-1) < 0.01


@pytest.mark.parametrize(("x", "wall", "shown"), [
    (-0.2, 0.5, False),  # behind the wall
    (-0.2, 2.0, True),  # before it
    (0.2, 0.5, True),  # beside it
])  # fmt: skip
def test_a_grasp_behind_an_object_is_not_drawn(x, wall, shown):
    assert marked((x, 0, 0.1), wall).any() == shown


def test_the_number_of_a_grasp_is_covered_by_no_other():
    camera = Camera(120, 90, 100.0, 100.0, 59.5, 44.5, look_at((0, -1, 0.3), (0, 0, 0.1)))
    grasp = Grasp(1, rigid(np.diag([1.0, -1, -1]), (0, 0, 0.1)), seal=1.0)
    one = RankedGrasp(grasp, grasp, Lift(1, "", {}))
    black = np.zeros((90, 120, 3), np.float32)
    white = [
        (mark_grasps(black, Ranking((one,) * n, {}, {}), camera, black[..., 0]) == 1).all(axis=-1)
        for n in (1, 2)
    ]
    assert white[1].sum() > 1.5 * white[0].sum()
