from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.types import GridSpec
from scenefw.perception.doctor import Doctor
from scenefw.perception.examination import Examiner
from scenefw.perception.floor import FloorFinder
from scenefw.perception.workspace import WorkspaceFinder

EXAMINER = Examiner(FloorFinder(), WorkspaceFinder(), Doctor(), GridSpec())
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


@pytest.mark.parametrize(
    ("frame", "last", "words", "floor"),
    [
        (replace(FRAME, depth=FRAME.depth * 1000), "unit", "millimetres given as metres?", False),
        (replace(FRAME, depth=FRAME.depth * 0), "unit", "no measurements", False),
        (replace(FRAME, depth=ROUGH), "floor", "no floor", False),
        (frame_of(camera_at(size=(160, 120)), boxes=()), "objects", "nothing stands", True),
    ],
    ids=["unit", "empty", "no floor", "no object"],
)
def test_an_unusable_image_ends_with_what_stops_it(frame, last, words, floor):
    found = EXAMINER.examine(frame)
    assert not found.usable
    assert (found.checks[-1].name, found.checks[-1].verdict) == (last, "unusable")
    assert words in found.checks[-1].found
    assert found.checks[-1].fix
    assert (found.floor is not None) == floor
    assert found.workspace is None


def test_a_mask_counts():
    found = EXAMINER.examine(FRAME, FRAME.labels == 2)
    assert (FRAME.labels[found.workspace.objects] == 2).all()
