import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.geometry import rigid
from scenefw.core.types import Camera, Frame
from scenefw.labelling.key_frames import ByMotion, ByOverlap, EveryNth, shared_view

DOWN = np.diag([1.0, -1.0, -1.0])
LENS = Camera().resized(320, 240)


def frame(x=0.0, depth=0.3, turn=0.0):
    c, s = np.cos(turn), np.sin(turn)
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    camera = LENS.moved(rigid(spin @ DOWN, (x, 0.0, depth)))
    return Frame(np.full((240, 320), depth, np.float32), camera)


def taken(schedule, frames):
    running = schedule.begin()
    return [running.takes(f) for f in frames]


def test_every_nth():
    assert taken(EveryNth(3), [frame()] * 7) == [True, False, False, True, False, False, True]
    schedule = EveryNth(2)
    for _ in range(2):  # each sequence starts anew
        assert taken(schedule, [frame()] * 3) == [True, False, True]


def test_motion_counts_from_the_last_key_frame():
    steps = [frame(0.02 * i) for i in range(5)]
    assert taken(ByMotion(distance=0.03, angle=1.0), steps) == [True, False, True, False, True]
    turns = [frame(turn=0.1 * i) for i in range(4)]
    assert taken(ByMotion(distance=1.0, angle=0.15), turns) == [True, False, True, False]


def test_overlap_of_shifted_views_is_that_of_rectangles():
    width = 320 / LENS.fx * 0.3  # of the table in view (m)
    for share in (0.25, 0.5, 0.9):
        seen = shared_view(frame((1 - share) * width), frame(0.0).camera)
        assert seen == pytest.approx(share, abs=0.03)
    assert shared_view(frame(2 * width), frame(0.0).camera) == 0
    assert shared_view(frame(), frame().camera) == 1


def test_overlap_schedule():
    width = 320 / LENS.fx * 0.3
    steps = [frame(0.1 * i * width) for i in range(5)]
    assert taken(ByOverlap(0.75), steps) == [True, False, False, True, False]


@pytest.mark.parametrize(
    "schedule", [EveryNth(3), ByMotion(distance=0.05, angle=0.3), ByOverlap(0.75)]
)
@pytest.mark.parametrize("cut", [0, 1, 2, 5])
def test_a_schedule_resumes_where_it_was(schedule, cut):
    steps = [frame(0.02 * i, turn=0.05 * i) for i in range(9)]
    before = schedule.begin()
    taken_before = [before.takes(f) for f in steps[:cut]]
    after = schedule.begin(before.state())
    taken_after = [after.takes(f) for f in steps[cut:]]
    whole = taken(schedule, steps)
    assert taken_before + taken_after == whole
    assert 2 <= sum(whole) <= 7


def test_the_state_of_another_schedule_starts_anew():
    counting, moving = EveryNth(3).begin(), ByMotion().begin()
    for running in (counting, moving):
        running.takes(frame())
    assert ByMotion().begin(counting.state()).takes(frame())
    assert EveryNth(3).begin(moving.state()).takes(frame())


@pytest.mark.parametrize(
    ("schedule", "wrong"),
    [(EveryNth, {"n": 0}), (ByMotion, {"angle": -1}), (ByOverlap, {"overlap": 2})],
)
def test_settings_are_checked(schedule, wrong):
    with pytest.raises(ConfigError, match="expected"):
        schedule(**wrong)
