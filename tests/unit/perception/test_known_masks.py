"""Masks of objects that a user gives: regions and ids."""

import numpy as np
import pytest
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.perception.grouping.relabelling import ObjectGrouping
from scenefw.perception.observation.floor_noise import MAX_FLOOR_HEIGHT
from scenefw.perception.segmentation.crease_segmentation import CreaseSegmentation

GRID = GridSpec(resolution=32)
CAMERA = camera_at(eye=(0.0, -0.85, 0.6))
FAR = Box((0.25, 0.05, 0.0), (0.35, 0.15, 0.1))
FRAME = frame_of(CAMERA, (*STACK, FAR))
ONE = (Box((-0.1, -0.08, 0.0), (0.1, 0.08, 0.12)),)


def test_only_the_region_counts():
    pipeline = pipeline_of(KnownBoxes(GRID))
    scene = pipeline.observe(FRAME)
    region = pipeline.observe(FRAME, FRAME.labels == 3)
    assert (scene.workspace.objects & (FRAME.labels == 3)).any()
    assert FRAME.labels[region.workspace.objects].min() == 3
    np.testing.assert_allclose(region.workspace.size[2], 0.1, atol=0.005)
    raised = (FRAME.labels > 0) & (FRAME.labels < 3) & (scene.heights > MAX_FLOOR_HEIGHT)
    assert (region.depth[raised] == 0).all()
    table = FRAME.labels == 0
    np.testing.assert_array_equal(region.depth[table] > 0, scene.depth[table] > 0)
    assert region.masks is None


def test_objects_beside_the_seen_table_are_found_in_a_region():
    table = Box((-0.18, -0.4, -0.02), (0.18, 0.3, 0.0))
    beside = Box((0.42, 0.05, 0.0), (0.52, 0.15, 0.1))
    frame = frame_of(CAMERA, (*STACK, beside), table)
    pipeline = pipeline_of(KnownBoxes(GRID))
    assert not (pipeline.observe(frame).workspace.objects & (frame.labels == 3)).any()
    assert (pipeline.observe(frame, frame.labels > 0).workspace.objects & (frame.labels == 3)).any()


def test_ids_decide_which_pixels_are_one_object():
    """A box of one instance, without any edge, cut where only the mask says so."""
    frame = frame_of(CAMERA, ONE)
    halves = np.where(frame.labels > 0, 1 + (np.arange(320) > 150), 0)
    rough = KnownBoxes(GRID, ONE)
    grouping = ObjectGrouping(rough, None, None)
    pipeline = pipeline_of(
        segmentation=CreaseSegmentation(), grouping=grouping, grid=GRID, samples=1
    )
    assert len(pipeline.estimate(frame).objects) == 1
    (estimate,) = pipeline(frame, halves)
    assert len(estimate.objects) == 2
    shown = (estimate.masks > 0) & (halves > 0)
    assert shown.sum() > 0.9 * (halves > 0).sum()
    counts = [np.bincount(estimate.masks[shown & (halves == i)], minlength=3) for i in (1, 2)]
    left, right = (count.argmax() for count in counts)
    assert left != right
    assert all(count.max() > 0.97 * count.sum() for count in counts)  # by voxels near the table
    assert estimate.objects[0].pose.position[0] * estimate.objects[1].pose.position[0] < 0


def test_a_region_where_nothing_stands_is_one_line():
    with pytest.raises(InputError, match="that the mask covers them and that the depth scale"):
        pipeline_of(KnownBoxes(GRID)).observe(FRAME, FRAME.labels == 0)
