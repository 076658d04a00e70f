import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenefw.core.geometry import rigid
from scenefw.core.types import TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.transforms import moved_object
from scenefw_tracking.rigid_motion import matched, rigid_motion


def thing(sides=(0.12, 0.08, 0.05), label=1):
    """A box about the origin."""
    mesh = trimesh.creation.box(sides)
    closed = TriangleMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces, np.int64))
    return estimate_objects({label: closed}, {})[0]


def moved_by(item, turn, place):
    return moved_object(item, rigid(Rotation.from_rotvec(turn).as_matrix(), place))


@settings(max_examples=10)
@given(
    turn=st.tuples(*[st.floats(-0.7, 0.7)] * 3),
    place=st.tuples(*[st.floats(-0.4, 0.4)] * 3),
)
def test_the_motion_of_a_box_is_found(turn, place):
    before = moved_by(thing(), (0, 0, 0.3), (0.1, 0, 0.05))
    after = moved_by(before, turn, place)
    motion = rigid_motion(before, after)
    assert motion.iou > 0.9
    again = moved_object(before, motion.matrix)
    np.testing.assert_allclose(again.pose.position, after.pose.position, atol=0.01)
    corners = [np.sort(item.mesh.vertices @ np.array([1.0, 1.7, 2.3])) for item in (again, after)]
    np.testing.assert_allclose(*corners, atol=0.06)


def test_what_lies_where_it_lay_has_not_moved():
    """Also a ball, which may have turned, and a shape that is a little larger now."""
    ball = trimesh.creation.icosphere(radius=0.05)
    solid = TriangleMesh(np.asarray(ball.vertices), np.asarray(ball.faces, np.int64))
    item = estimate_objects({1: solid}, {})[0]
    assert rigid_motion(item, item).is_rest
    assert rigid_motion(item, item).iou == pytest.approx(1, abs=0.05)
    assert rigid_motion(thing(), thing((0.122, 0.081, 0.051))).is_rest
    shifted = rigid_motion(item, moved_object(item, rigid(np.eye(3), (0.02, 0, 0))))
    np.testing.assert_allclose(shifted.matrix, rigid(np.eye(3), (0.02, 0, 0)), atol=1e-6)


def test_objects_of_other_sizes_or_shapes_are_others():
    assert rigid_motion(thing(), thing((0.3, 0.1, 0.02))).iou < 0.5
    assert rigid_motion(thing(), thing((0.06, 0.04, 0.02))).iou == 0
    assert matched({1: thing()}, {5: thing((0.3, 0.1, 0.02))}) == {}
    assert matched({}, {5: thing()}) == {}
    assert matched({1: thing()}, {}) == {}


def test_of_objects_that_are_alike_each_is_the_nearest():
    cubes = [thing((0.05,) * 3, label) for label in (1, 2)]
    near = rigid(np.eye(3), (0.02, 0, 0))
    before = {1: cubes[0], 2: moved_object(cubes[1], rigid(np.eye(3), (0.3, 0, 0)))}
    after = {
        7: moved_object(before[2], near),
        8: moved_object(before[1], near),
        9: moved_object(thing((0.2, 0.02, 0.02)), near),
    }
    pairs = matched(before, after)
    assert {new: old for new, (old, _) in pairs.items()} == {7: 2, 8: 1}
    for _, motion in pairs.values():
        np.testing.assert_allclose(motion.matrix[:3, 3], (0.02, 0, 0), atol=1e-6)
        assert motion.shift == pytest.approx(0.02)
