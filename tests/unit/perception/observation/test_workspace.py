import numpy as np
import pytest
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.types import Frame, GridSpec
from scenefw.data.files.readers import read_frames
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.workspace import OUTSIDE_CUBE, WorkspaceFinder

GRID = GridSpec()


def workspace_of(frame, grid=GRID, **settings):
    floor = FloorFinder(max_depth=3.0).find(frame)
    return WorkspaceFinder(OBSTACLES, **settings).find(frame, floor, grid)


def moved(boxes, x, y):
    shift = np.array([x, y, 0.0])
    return tuple(Box(tuple(b.lower + shift), tuple(b.upper + shift)) for b in boxes)


@pytest.mark.parametrize("resolution", [32, 64])
@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (0.3, 0.2), (-0.25, 0.35)])
def test_stack_is_centred(x, y, resolution):
    frame = frame_of(camera_at(eye=(0, -1, 0.8), target=(x / 2, y / 2, 0)), moved(STACK, x, y))
    workspace = workspace_of(frame, GridSpec(resolution=resolution))
    seen = world_points(workspace.frame)[workspace.objects]
    low, high = seen[:, :2].min(axis=0), seen[:, :2].max(axis=0)
    np.testing.assert_allclose((low + high) / 2, 0, atol=0.025)
    assert workspace.size[2] == pytest.approx(0.20, abs=0.006)
    assert len(workspace.left_out) == 0
    truth = frame.labels > 0
    assert workspace.objects[truth].mean() > 0.85
    assert truth[workspace.objects].mean() > 0.99


def test_background_becomes_no_measurement_and_the_table_endless():
    table = Box((-0.4, -0.4, -0.03), (0.4, 0.4, 0.0))
    behind = Box((-0.5, 0.8, -0.7), (0.5, 0.9, 0.6))
    camera = camera_at(eye=(0.0, -1.1, 0.7))
    frame = frame_of(camera, (*STACK, behind), table=table, room=-0.7)
    workspace = workspace_of(frame)
    heights = world_points(workspace.frame)[..., 2]
    original = world_points(Frame(frame.depth, workspace.frame.camera))
    chair = (frame.labels == 3) & (original[..., 2] > 0.03)
    assert chair.sum() > 500
    assert (workspace.frame.depth[chair] == 0).all()
    carpet = original[..., 2] < -0.1
    assert carpet.sum() > 500
    np.testing.assert_allclose(heights[carpet], 0, atol=1e-4)
    on_stack = np.isin(frame.labels, (1, 2))
    np.testing.assert_array_equal(workspace.frame.depth[on_stack], frame.depth[on_stack])


def test_far_group_is_left_out_and_named():
    boxes = (*STACK, Box((0.9, 0.3, 0.0), (0.98, 0.38, 0.1)))
    frame = frame_of(camera_at(eye=(0.3, -1.3, 1.0), target=(0.3, 0, 0)), boxes)
    workspace = workspace_of(frame)
    assert len(workspace.left_out) == 1
    assert not workspace.objects[frame.labels == 3].any()
    np.testing.assert_allclose(workspace.left_out[0], (0.94, 0.34), atol=0.06)
    (obstacle,) = workspace.obstacles  # an arm must not hit it
    assert obstacle.kind == OUTSIDE_CUBE
    assert (frame.labels[obstacle.pixels] == 3).mean() > 0.99
    assert not workspace.frame.depth[obstacle.pixels].any()
    assert workspace.frame.depth[workspace.objects].all()
    assert not workspace.unsupported.any()


def test_objects_larger_than_the_cube_are_one_line():
    wide = Box((-0.6, -0.1, 0.0), (0.6, 0.1, 0.15))
    frame = frame_of(camera_at(eye=(0, -1.5, 1.0)), (wide,))
    with pytest.raises(InputError, match=r"cover 1\.\d+ m") as error:
        workspace_of(frame)
    assert "\n" not in str(error.value)
    assert "cube holds" in str(error.value)


def test_an_empty_table_has_its_middle_in_the_cube():
    """Of several views, or where objects are known to be, it is one line."""
    frame = frame_of(camera_at(), ())
    workspace = workspace_of(frame)
    assert not workspace.objects.any()
    assert (workspace.size == 0).all()
    points = world_points(workspace.frame).reshape(-1, 3)
    np.testing.assert_allclose(np.median(points, axis=0), 0, atol=1e-6)
    both = WorkspaceFinder(OBSTACLES).find_together([workspace.frame] * 2, GRID)
    assert [one.objects.any() for one in both] == [False, False]
    floor = FloorFinder().find(frame)
    with pytest.raises(InputError, match="that the mask covers them"):
        WorkspaceFinder(OBSTACLES).find(frame, floor, GRID, np.ones(frame.depth.shape, bool))


def test_marked_flat_things_have_a_workspace():
    pen = Box((0.20, 0.1, 0.0), (0.34, 0.115, 0.008))
    frame = frame_of(camera_at(), (pen,))
    floor = FloorFinder(max_depth=3.0).find(frame)
    workspace = WorkspaceFinder(OBSTACLES).find(frame, floor, GRID, frame.labels == 1)
    assert workspace.objects[frame.labels == 1].mean() > 0.9
    assert not workspace.objects[frame.labels == 0].any()
    assert workspace.size[2] == pytest.approx(0.008, abs=0.002)


def test_real_objects_are_found(real_data):
    for frame in read_frames(real_data / "real" / "mosd_learn")[3::10]:
        workspace = workspace_of(frame)
        truth = frame.labels > 0
        assert workspace.objects[truth].mean() > 0.85, frame.name
        assert truth[workspace.objects].mean() > 0.99, frame.name
