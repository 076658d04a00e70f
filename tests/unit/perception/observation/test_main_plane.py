"""A recording's table is the plane that most of it looks at, not that of its first frame."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.geometry import rigid
from scenefw.perception.observation.table_frame import TableFrame

TOP = Box((-0.5, -0.4, -0.03), (0.5, 0.4, 0.0))
ROOM = -0.5  # height of the floor beside the table
WORLD = rigid(np.eye(3), (0.3, 0.1, 0.9))  # of the poses: their z = 0 is no table


def view(eye, target, number):
    camera = camera_at(eye, target, size=(80, 60))
    frame = frame_of(camera, STACK, table=TOP, room=ROOM, name=f"{number:03d}")
    return replace(frame, camera=camera.moved(WORLD @ camera.T_world_camera))


def recording(beside, above):
    """Frames of the floor beside the table, then of the table."""
    floor = [view((1.6, -0.3 + 0.05 * n, 0.3), (1.6, 0.3, ROOM), n) for n in range(beside)]
    table = [view((0.02 * n, -0.6, 0.6), (0.0, 0.0, 0.0), n) for n in range(beside, beside + above)]
    return floor + table


@pytest.mark.parametrize(("beside", "above"), [(1, 5), (2, 8), (0, 4)])
def test_the_plane_of_most_frames_is_the_table(beside, above):
    first, *others = recording(beside, above)
    alignment = TableFrame().alignment(first, posed=True, further_frames=others)
    height = (alignment.T_table_world @ WORLD)[2, 3]  # of the table's top
    assert height == pytest.approx(0.0, abs=0.005)
    assert f"found in frame {beside:03d}" in alignment.note or not beside
    if beside:
        alone = TableFrame().alignment(first, posed=True)
        assert (alone.T_table_world @ WORLD)[2, 3] == pytest.approx(-ROOM, abs=0.01)


def test_frames_without_a_plane_do_not_matter():
    dark = replace(view((0, -0.6, 0.6), (0, 0, 0), 0), depth=np.zeros((60, 80), np.float32))
    alignment = TableFrame().alignment(dark, posed=True, further_frames=recording(0, 3))
    assert (alignment.T_table_world @ WORLD)[2, 3] == pytest.approx(0.0, abs=0.005)
    nothing = TableFrame().alignment(dark, posed=True, further_frames=[dark])
    assert not nothing.table
