"""What `Settling` promises is enough for those who read it."""

import numpy as np

from scenefw.core.settled import Settled, words
from scenefw.core.types import Camera, Frame, GridSpec, SceneEstimate


def scene(settled: Settled) -> SceneEstimate:
    frame = Frame(np.ones((2, 2), np.float32), Camera(2, 2, 2, 2, 0.5, 0.5))
    volume = np.zeros((2, 2, 2))
    return SceneEstimate((), GridSpec(2), volume, volume, frame, {"settled": settled})


def test_the_least_that_it_says_is_told():
    still: Settled = {"objects": [], "stable": True, "reason": "all is glued"}
    assert words(scene(still)) == "settled: all is glued"
    rows = [{"id": 1, "moved": 0.012, "turned": 3.0}, {"id": 2, "stays": "it is glued"}]
    found = words(scene({"objects": rows, "stable": False}))
    assert "object 1 moved 1.2 cm and 3°" in found
    assert "object 2 stays as it was (it is glued)" in found
