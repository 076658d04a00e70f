"""Objects that nothing carries go on to the floor or to what is below them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from tests.unit.perception.evidence.test_gathering import scene_of
from tests.unit.shapes.test_object_shell import slabs

from scenefw.core import geometry
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.types import Pose
from scenefw.fitting.placed import shape_of
from scenefw.perception.completion.support import extend_shells, extend_to_support
from scenefw.perception.steps import Objects, ObjectSet

GRID = scene_of(32)[1].grid
CLOSED = np.zeros(GRID.shape, dtype=bool)
"""What a view that sees through nothing shows to be free."""


def standing(*objects, free=CLOSED):
    return extend_to_support(objects, free, GRID)


def box(lower, upper, turn=None):
    """A box by two corners; `turn` says how its own axes lie, its place stays."""
    lower, upper = np.array(lower), np.array(upper)
    turn = np.eye(3) if turn is None else turn
    half = np.abs(turn.T @ (upper - lower)) / 2
    pose = Pose((lower + upper) / 2, geometry.quaternion_from_rotation(turn))
    return FittedSuperquadric(half, np.full(3, 40.0), pose, 0.0, np.empty(0))


def ends(one):
    """Lower and upper corner of the box about it."""
    corners = shape_of(one).mesh(8).vertices @ one.pose.rotation.T + one.pose.position
    return corners.min(axis=0), corners.max(axis=0)


WAYS = [np.eye(3), np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.diag([1.0, -1, -1])]


@pytest.mark.parametrize("turn", WAYS)
def test_a_box_in_the_air_goes_on_to_the_floor(turn):
    one = box((0.0, 0.0, 0.05), (0.1, 0.06, 0.12), turn)
    (found,) = standing(one)
    lower, upper = ends(found)
    assert np.allclose(lower, (0, 0, 0), atol=2e-3)
    assert np.allclose(upper, (0.1, 0.06, 0.12), atol=2e-3)


@pytest.mark.parametrize("turn", WAYS)
def test_a_box_in_the_air_goes_on_to_the_box_below_it(turn):
    below = box((-0.02, -0.02, 0.0), (0.12, 0.12, 0.03))
    beside = box((0.3, 0.0, 0.0), (0.4, 0.1, 0.04))
    found = standing(box((0.0, 0.0, 0.08), (0.1, 0.06, 0.12), turn), below, beside)
    assert found[1:] == [below, beside]
    assert abs(ends(found[0])[0][2] - 0.03) < 0.008
    assert abs(ends(found[0])[1][2] - 0.12) < 2e-3


def test_a_box_that_sinks_into_the_floor_ends_there():
    (found,) = standing(box((0.0, 0.0, -0.02), (0.1, 0.06, 0.06)))
    lower, upper = ends(found)
    assert np.allclose([lower[2], upper[2]], [0.0, 0.06], atol=2e-3)
    below = box((0.0, 0.0, -0.05), (0.1, 0.06, 0.002))  # nothing would be left of it
    assert standing(below) == [below]


def test_what_is_carried_or_tilted_or_seen_through_stays():
    carried = [box((0, 0, 0), (0.1, 0.1, 0.05)), box((0.05, 0, 0.055), (0.15, 0.1, 0.1))]
    assert standing(*carried) == carried
    tilted = box((0, 0, 0.05), (0.1, 0.06, 0.12), Rotation.from_euler("x", 40, True).as_matrix())
    assert standing(tilted) == [tilted]
    hanging = box((0.0, 0.0, 0.08), (0.1, 0.06, 0.12))
    assert standing(hanging, free=~CLOSED) == [hanging]


@given(
    st.floats(-0.03, 0.1), st.floats(0.08, 0.2), st.floats(-17.0, 17.0), st.floats(-180.0, 180.0)
)
def test_the_upper_end_stays_and_the_lower_one_comes_to_the_floor(low, height, tilt, around):
    turn = Rotation.from_euler("zx", (around, tilt), degrees=True).as_matrix()
    one = box((0.0, 0.0, low), (0.08, 0.05, low + height), np.eye(3))
    one = replace(one, pose=Pose(one.pose.position, geometry.quaternion_from_rotation(turn)))
    (found,) = standing(one)
    up = one.pose.rotation[:, 2]
    tops = [x.pose.position + x.half_axes[2] * up for x in (one, found)]
    assert np.allclose(*tops, atol=1e-6)
    assert -0.01 < ends(found)[0][2] < 0.012  # on the floor, however it was before


def extended(free=CLOSED, **superquadrics):
    """A shell from 10 to 20 cm above the floor, of which a camera above it sees the top alone."""
    pixels = np.ones((4, 4), np.int32)
    points = np.full((4, 4, 3), (0.0, 0.0, 0.2))
    shapes = {int(label[1:]): shape for label, shape in superquadrics.items()}
    hypothesis = ObjectSet(Objects(pixels), shapes, shells={1: slabs(0.0)})
    view = SimpleNamespace(points=points, clear=free, grid=GRID)
    return extend_shells(hypothesis, view).shells[1]


def test_a_shell_in_the_air_goes_on_to_the_floor():
    shell = extended()
    heights = shell.places()[:, 2]
    assert heights.min() == pytest.approx(0, abs=1e-6)
    assert heights.max() == pytest.approx(0.2, abs=1e-6)


def test_a_shell_in_the_air_goes_on_to_what_is_below_it():
    below = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.05))
    itself = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.09))
    assert extended(_1=itself, _2=below).places()[:, 2].min() == pytest.approx(0.05, abs=0.006)


def test_a_shell_below_which_the_view_sees_through_stays():
    assert extended(free=np.ones_like(CLOSED)).foot is None
