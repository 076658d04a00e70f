"""Boxes on a table, of some of which masks know nothing."""

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.perception.estimate.lost_objects import lost_objects
from scenefw.perception.observation.doctor import NO_OBJECTS

BESIDE = Box((0.25, 0.1, 0.0), (0.35, 0.2, 0.1))


@pytest.fixture(params=[(160, 120), (320, 240)])
def frame(request):
    return frame_of(camera_at(size=request.param), (*STACK, BESIDE), noise=0.001)


def line(frame, masks):
    return lost_objects(masks.astype(np.int32), frame.labels > 0, frame.depth)


def test_an_object_without_a_mask_is_told(frame):
    share = (frame.labels == 3).sum() / (frame.labels > 0).sum()
    words = line(frame, np.where(frame.labels == 3, 0, frame.labels))
    assert words.startswith(f"{share:.0%} of what stands on the floor became no object")
    assert "right of the image" in words


def test_an_image_without_any_object_is_told(frame):
    assert line(frame, np.zeros_like(frame.labels)) == NO_OBJECTS.line


@pytest.mark.parametrize("seed", [0, 1])
def test_edges_and_specks_are_no_lost_objects(frame, seed):
    assert line(frame, frame.labels) is None
    lost = np.random.default_rng(seed).random(frame.labels.shape) < 0.3
    assert line(frame, np.where(lost, 0, frame.labels)) is None
