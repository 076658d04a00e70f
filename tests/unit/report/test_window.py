import pytest
from tests.unit.report.test_overview import estimate_of

from scenefw.report.window import window


def test_window_shows_the_objects_in_the_pictures_proportions():
    estimate = estimate_of()
    rows, columns = window(estimate, aspect=4 / 3)
    height, width = rows.stop - rows.start, columns.stop - columns.start
    assert width / height == pytest.approx(4 / 3, rel=0.03)
    pose = estimate.frame.camera.T_world_camera
    local = (estimate.objects[0].mesh.vertices - pose[:3, 3]) @ pose[:3, :3]
    pixels = local[:, :2] / local[:, 2:] * 180 + (79.5, 59.5)
    assert (pixels > (columns.start, rows.start)).all()
    assert (pixels < (columns.stop, rows.stop)).all()
    assert rows.start >= 0
    assert columns.start >= 0
    assert rows.stop <= 120
    assert columns.stop <= 160


def test_window_without_objects_is_the_middle_of_the_image():
    empty = estimate_of(objects=0)
    assert window(empty) == (slice(0, 120), slice(0, 160))
    rows, columns = window(empty, aspect=16 / 9)
    assert (rows.stop - rows.start, columns) == (90, slice(0, 160))
    assert rows.start == 15
    rows, columns = window(empty, aspect=1.0)
    assert (rows, columns) == (slice(0, 120), slice(20, 140))
