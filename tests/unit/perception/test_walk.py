"""One prediction of the pipeline that ships, followed from step to step."""

import numpy as np
import pytest
from hydra.utils import instantiate
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw import config

WALK = {
    "observe": "observer",
    "segment": "segmentation",
    "restore": "edges",
    "group": "grouping",
    "fit": "fit",
    "complete": "completion",
    "replace": "hollow",
    "assemble": "assembly",
    "rank": "ranking",
}
"""What each step does, in the order of the steps, and the step."""
SIDES = ((0.08, 0.08, 0.1), (0.06, 0.08, 0.06))
CENTRES = (-0.12, 0.12)  # along x (m)


class Traced:
    """A step whose calls are written down: name, arguments and result."""

    def __init__(self, step, calls):
        self.step, self.calls = step, calls

    def __getattr__(self, name):
        value = getattr(self.step, name)
        if not callable(value):
            return value

        def call(*arguments, **settings):
            self.calls.append([name, arguments, None])
            entry = self.calls[-1]
            entry[2] = value(*arguments, **settings)
            return entry[2]

        return call


def drawn_boxes():
    """Two boxes beside each other, seen along +y."""
    boxes = [
        Box((x - a / 2, -b / 2, 0.0), (x + a / 2, b / 2, c))
        for x, (a, b, c) in zip(CENTRES, SIDES, strict=True)
    ]
    return frame_of(camera_at(size=(640, 480)), boxes=boxes, noise=0.0005)


@pytest.fixture(scope="module")
def walk():
    """The image, the calls of steps in their order, and the scenes that come out."""
    words = ["run=predict", "input=x", "device=cpu", "reconstructor.samples=2"]
    pipeline = instantiate(config.compose(words).run.pipeline)
    calls = []
    for step in WALK.values():
        setattr(pipeline, step, Traced(getattr(pipeline, step), calls))
    frame = drawn_boxes()
    return frame, calls, pipeline(frame)


def test_nine_steps_are_called_once_each_and_in_their_order(walk):
    _, calls, _ = walk
    assert [name for name, *_ in calls] == list(WALK)


def test_each_step_takes_what_the_one_before_gave(walk):
    frame, calls, scenes = walk
    arguments = {name: taken for name, taken, _ in calls}
    results = {name: given for name, _, given in calls}
    view, segments = results["restore"]
    assert arguments["observe"][0] is frame
    assert arguments["segment"] == (results["observe"],)
    assert arguments["restore"] == (results["observe"], results["segment"])
    assert arguments["group"] == (segments, view)
    assert arguments["fit"] == (results["group"], view)
    assert arguments["complete"][:3] == (results["fit"], view, 2)
    assert arguments["replace"] == (results["complete"], view)
    assert arguments["assemble"][:2] == (results["replace"], view)
    assert len(arguments["rank"][0]) == 2
    assert scenes is results["rank"]


def test_the_boxes_are_what_comes_out(walk):
    _, _, scenes = walk
    assert len(scenes) == 2
    for scene in scenes:
        left, right = sorted(scene.objects, key=lambda item: item.pose.position[0])
        for item, sides in zip((left, right), SIDES, strict=True):
            np.testing.assert_allclose(np.sort(item.extents), np.sort(sides), atol=0.015)
        apart = right.pose.position - left.pose.position
        assert np.linalg.norm(apart[:2]) == pytest.approx(CENTRES[1] - CENTRES[0], abs=0.015)
