import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.types import Frame
from scenefw.data.files.readers import read_frames
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.points import camera_points, world_points


@given(
    elevation=st.floats(15, 80),
    azimuth=st.floats(0, 360),
    roll=st.floats(-180, 180),
    distance=st.floats(0.6, 1.3),
)
def test_finds_height_and_tilt(elevation, azimuth, roll, distance):
    e, a = np.radians(elevation), np.radians(azimuth)
    eye = distance * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    camera = camera_at(eye, roll=np.radians(roll), size=(160, 120))
    frame = frame_of(camera, noise=0.001)
    floor = FloorFinder().find(frame)
    up = camera.T_world_camera[:3, :3].T @ (0, 0, 1)
    assert np.degrees(np.arccos(np.clip(floor.normal @ up, -1, 1))) < 1.0
    assert floor.height == pytest.approx(eye[2], abs=0.008)


def test_pose_is_rigid_and_looks_along_y():
    camera = camera_at(eye=(0.5, 0.6, 0.7))
    frame = frame_of(camera)
    pose = FloorFinder().find(frame).T_world_camera
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-9)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1)
    forward = pose[:3, 2]
    assert forward[1] > 0.3
    assert forward[0] == pytest.approx(0, abs=1e-9)
    heights = world_points(Frame(frame.depth, frame.camera.moved(pose)))[..., 2]
    np.testing.assert_allclose(heights[frame.labels == 0], 0, atol=0.004)
    assert np.nanmax(heights) == pytest.approx(0.20, abs=0.005)


def test_straight_down_has_a_pose():
    camera = camera_at(eye=(0.0, 1e-3, 1.0), target=(0, 0, 0))
    pose = FloorFinder().find(frame_of(camera)).T_world_camera
    np.testing.assert_allclose(pose[:3, 2], (0, 0, -1), atol=0.01)
    assert np.isfinite(pose).all()


def test_same_image_same_floor():
    frame = frame_of(camera_at(), noise=0.003)
    first, second = FloorFinder().find(frame), FloorFinder().find(frame)
    np.testing.assert_array_equal(first.normal, second.normal)
    assert first.height == second.height


@pytest.mark.parametrize(("width", "room"), [(0.9, -0.7), (0.6, -0.5), (0.5, -0.35)])
def test_prefers_the_table_to_the_room_below_it(width, room):
    """Also a side table, around which much more of the room's floor is seen."""
    table = Box((-width / 2, -0.25, -0.03), (width / 2, 0.25, 0.0))
    camera = camera_at(eye=(0.0, -1.0, 0.8))
    frame = frame_of(camera, table=table, room=room)
    assert FloorFinder().find(frame).height == pytest.approx(0.8, abs=0.01)


def test_a_large_box_side_is_no_floor():
    wall = Box((-0.45, 0.0, 0.0), (0.45, 0.1, 0.5))
    camera = camera_at(eye=(0.0, -0.9, 0.5), target=(0, 0, 0.1))
    frame = frame_of(camera, boxes=(wall,))
    assert (frame.labels == 1).mean() > 0.35
    floor = FloorFinder().find(frame)
    up = camera.T_world_camera[:3, :3].T @ (0, 0, 1)
    assert floor.normal @ up > 0.999


@pytest.mark.parametrize("roll", [0, 90, 180, 270])
def test_a_wall_is_no_floor_however_the_camera_is_rolled(roll):
    wall = Box((-1.5, -0.32, 0.0), (1.5, -0.3, 0.5))
    camera = camera_at(eye=(0.0, 0.7, 0.7), roll=np.radians(roll), size=(160, 120))
    frame = frame_of(camera, [wall], noise=0.001)
    floor = FloorFinder().find(frame)
    assert floor.normal @ camera.T_world_camera[:3, :3].T @ (0, 0, 1) > 0.999
    assert floor.height == pytest.approx(0.7, abs=0.008)


def test_no_floor_is_transparent():
    """Tops of two boxes make the largest plane, but the table is seen between them."""
    tops = (
        Box((-0.5, -0.35, 0.0), (-0.2, 0.35, 0.1)),
        Box((0.2, -0.35, 0.0), (0.5, 0.35, 0.1)),
    )
    camera = camera_at(eye=(0.0, -0.5, 0.8))
    frame = frame_of(camera, boxes=tops, noise=0.001)
    assert FloorFinder().find(frame).height == pytest.approx(0.8, abs=0.005)


@pytest.mark.parametrize("shift", [0.0, 5.0])
def test_no_plane_is_one_line(shift):
    random = np.random.default_rng(0)
    camera = camera_at()
    depth = (shift + random.uniform(0.5, 1.9, (240, 320))).astype(np.float32)
    with pytest.raises(InputError, match="no floor in noise") as error:
        FloorFinder(min_inlier_ratio=0.3).find(Frame(depth, camera, name="noise"))
    assert "\n" not in str(error.value)


def test_camera_points_are_on_their_rays():
    frame = frame_of(camera_at())
    points = camera_points(frame, stride=2)
    assert points.shape == (120, 160, 3)
    camera = frame.camera
    v, u = 35, 60
    expected = (np.array([2 * u, 2 * v]) - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    np.testing.assert_allclose(points[v, u, :2] / points[v, u, 2], expected)
    assert np.isnan(camera_points(Frame(frame.depth * 0, camera))).all()


def test_real_tables_lie_on_the_floor(real_data):
    for frame in read_frames(real_data / "real" / "mosd_learn")[::9]:
        pose = FloorFinder().find(frame).T_world_camera
        heights = world_points(Frame(frame.depth, frame.camera.moved(pose)))[..., 2]
        table, objects = heights[frame.labels == 0], heights[frame.labels > 0]
        assert np.mean(np.abs(table) < 0.01) > 0.99, frame.name
        assert np.mean(objects > 0.005) > 0.93, frame.name


def test_real_table_not_the_carpet(real_data):
    """In uois_5 more carpet than table is seen."""
    (frame,) = read_frames(real_data / "real" / "realsense_table" / "uois_5.npz")
    assert 0.4 < FloorFinder().find(frame).height < 0.5
