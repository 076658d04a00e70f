from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.workspace import WorkspaceFinder
from scenefw_doctor.examination import Examiner

EXAMINER = Examiner(FloorFinder(), WorkspaceFinder(OBSTACLES), Doctor(), GridSpec())
FRAME = frame_of(camera_at(size=(160, 120)))


def test_a_good_image_passes_every_check():
    found = EXAMINER.examine(FRAME)
    assert found.usable
    assert {check.verdict for check in found.checks} == {"good"}
    names = [check.name for check in found.checks]
    assert names == ["unit", "intrinsics", "centre", "measured", "floor", "tilt", "distance",
                     "size", "groups"]  # fmt: skip
    said = {check.name: check.found for check in found.checks}
    assert "0.60 m above the floor" in said["tilt"]
    assert "20 cm" in said["size"]


ROUGH = np.random.default_rng(0).uniform(0.5, 1.9, FRAME.depth.shape).astype(np.float32)


WIDE = frame_of(
    camera_at(eye=(0, -1.5, 1.0), size=(160, 120)), (Box((-0.6, -0.1, 0.0), (0.6, 0.1, 0.15)),)
)


@pytest.mark.parametrize(
    ("frame", "last", "words", "floor"),
    [
        (replace(FRAME, depth=FRAME.depth * 1000), "unit", "millimetres given as metres?", False),
        (replace(FRAME, depth=FRAME.depth * 0), "unit", "no measurements", False),
        (replace(FRAME, depth=ROUGH), "floor", "no floor", False),
        (WIDE, "objects", "without a gap", True),
    ],
    ids=["unit", "empty", "no floor", "too large"],
)
def test_an_unusable_image_ends_with_what_stops_it(frame, last, words, floor):
    found = EXAMINER.examine(frame)
    assert not found.usable
    assert (found.checks[-1].name, found.checks[-1].verdict) == (last, "unusable")
    assert words in found.checks[-1].found
    assert found.checks[-1].fix
    assert (found.floor is not None) == floor
    assert found.workspace is None


def test_a_bare_table_is_odd():
    found = EXAMINER.examine(frame_of(camera_at(size=(160, 120)), boxes=()))
    assert found.usable
    assert (found.checks[-1].name, found.checks[-1].verdict) == ("objects", "odd")
    assert found.checks[-1].fix


def test_a_mask_counts():
    found = EXAMINER.examine(FRAME, FRAME.labels == 2)
    assert (FRAME.labels[found.workspace.objects] == 2).all()
