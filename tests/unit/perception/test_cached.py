import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF
from scenefw.core.types import GridSpec
from scenefw.perception.cached import Cached
from scenefw.perception.observation.observation import Observation
from scenefw.perception.steps import Objects

GRID = GridSpec(resolution=4)


class Counting:
    """Numbers its answers, which are segments or objects of two pixels."""

    def __init__(self):
        self.calls = 0

    def segment(self, view):
        self.calls += 1
        return np.full((1, 2), self.calls, np.int32)

    def group(self, segments, view):
        self.calls += 1
        return Objects(segments + self.calls)


def view():
    volume = torch.zeros(1, 1, *GRID.shape)
    return Observation(None, PartialTSDF(volume, volume > 0), GRID)


def test_the_same_question_is_answered_once():
    step, scene = Counting(), view()
    cached = Cached(step)
    segments = cached.segment(scene)
    assert cached.segment(scene) is segments
    assert step.calls == 1
    objects = cached.group(segments, scene)
    assert cached.group(segments, scene) is objects
    assert step.calls == 2
    np.testing.assert_array_equal(objects.pixels, [[3, 3]])
    # of another observation of the same volume, as each method of an evaluation makes its own
    assert cached.segment(Observation(None, scene.partial, GRID)) is segments


def test_another_question_is_asked_anew():
    step, scene = Counting(), view()
    cached = Cached(step)
    segments = cached.segment(scene)
    cached.segment(view())  # equal, but another view
    assert step.calls == 2
    objects = cached.group(segments, scene)
    assert cached.group(segments.copy(), scene) is not objects
    assert cached.group(segments, view()) is not objects
    assert step.calls == 5


@pytest.mark.parametrize("size", [1, 3])
def test_only_the_last_results_are_kept(size):
    step, scenes = Counting(), [view() for _ in range(size + 1)]
    cached = Cached(step, size)
    for scene in scenes[:size] * 2:
        cached.segment(scene)
    assert step.calls == size
    cached.segment(scenes[size])  # in place of the first
    assert step.calls == size + 1
    cached.segment(scenes[0])
    assert step.calls == size + 2


def test_threads_and_copies_have_their_own_results():
    step, scene = Counting(), view()
    cached = Cached(step, 2)
    cached.segment(scene)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(cached.segment, scene).result()
    assert step.calls == 2
    copy = pickle.loads(pickle.dumps(cached))
    assert copy.size == 2
    copy.segment(scene)
    assert (copy.step.calls, step.calls) == (3, 2)
