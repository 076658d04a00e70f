import numpy as np
import pytest
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.geometry import rigid
from scenefw.core.types import Camera, Frame
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.table_frame import TableFrame

EYE = camera_at(eye=(0.0, -0.5, 0.6), size=(160, 120))


def posed():
    """A frame that knows where its camera is."""
    return Frame(frame_of(EYE).depth, EYE)


def test_a_frame_is_put_on_its_table():
    frame = TableFrame().rectified(frame_of(EYE))
    assert frame.camera.T_world_camera[2, 3] == pytest.approx(0.6, abs=0.005)
    points = world_points(frame)
    heights = points[..., 2][np.isfinite(points[..., 2])]
    assert np.median(np.abs(heights)) < 0.005
    low = np.abs(points[..., 2]) < 0.3
    assert np.median(points[low][:, :2], axis=0) == pytest.approx([0, 0], abs=0.03)


def test_poses_of_the_table_are_kept():
    alignment = TableFrame().alignment(posed(), posed=True)
    np.testing.assert_array_equal(alignment.T_table_world, np.eye(4))
    assert not alignment.note


@pytest.mark.parametrize(
    "moved",
    [rigid(np.eye(3), (0.0, 0.0, 0.5)), rigid(np.diag([1.0, -1.0, -1.0]), (1.0, 0.0, 0.0))],
)
def test_poses_of_another_world_are_not(moved):
    frame = posed()
    other = Frame(frame.depth, frame.camera.moved(moved @ frame.camera.T_world_camera))
    alignment = TableFrame().alignment(other, posed=True)
    assert alignment.note
    back = Frame(
        frame.depth, frame.camera.moved(alignment.T_table_world @ other.camera.T_world_camera)
    )
    points = world_points(back)[..., 2]
    assert np.nanmedian(np.abs(points)) < 0.005


def test_without_a_table():
    nothing = Frame(np.zeros((120, 160), np.float32), Camera().resized(160, 120), name="dark")
    kept = TableFrame().alignment(nothing, posed=True)
    np.testing.assert_array_equal(kept.T_table_world, np.eye(4))
    assert "as they are" in kept.note
    for wrong in (
        lambda: TableFrame().alignment(nothing, posed=False),
        lambda: TableFrame().rectified(nothing),
    ):
        with pytest.raises(InputError, match="dark"):
            wrong()
