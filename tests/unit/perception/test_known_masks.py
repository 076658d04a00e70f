"""Masks of objects that a user gives: regions and ids."""

import numpy as np
import pytest
from tests.unit.perception.synthetic import STACK, Box, camera_at, frame_of
from tests.unit.perception.test_pipeline import KnownBoxes

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.mapping.projective import Projective
from scenefw.perception.grouping.division import GroupedByNetwork
from scenefw.perception.grouping.relabelling import PartGuided
from scenefw.perception.pipeline import Pipeline
from scenefw.perception.segmentation.crease_segmentation import SeenParts

GRID = GridSpec(resolution=32)
CAMERA = camera_at(eye=(0.0, -0.85, 0.6))
FAR = Box((0.25, 0.05, 0.0), (0.35, 0.15, 0.1))
FRAME = frame_of(CAMERA, (*STACK, FAR))
ONE = (Box((-0.1, -0.08, 0.0), (0.1, 0.08, 0.12)),)


def test_only_the_region_counts():
    pipeline = Pipeline(KnownBoxes(GRID), Projective())
    whole = pipeline.prepare(FRAME)
    part = pipeline.prepare(FRAME, FRAME.labels == 3)
    assert (whole.workspace.objects & (FRAME.labels == 3)).any()
    assert FRAME.labels[part.workspace.objects].min() == 3
    np.testing.assert_allclose(part.workspace.size[2], 0.1, atol=0.005)
    raised = (FRAME.labels > 0) & (FRAME.labels < 3) & whole.workspace.objects
    assert (part.workspace.frame.depth[raised] == 0).all()
    table = FRAME.labels == 0
    np.testing.assert_array_equal(
        part.workspace.frame.depth[table] > 0, whole.workspace.frame.depth[table] > 0
    )
    assert part.partial.masks is None


def test_objects_beside_the_seen_table_are_found_in_a_region():
    table = Box((-0.18, -0.4, -0.02), (0.18, 0.3, 0.0))
    beside = Box((0.3, 0.05, 0.0), (0.4, 0.15, 0.1))
    frame = frame_of(CAMERA, (*STACK, beside), table)
    pipeline = Pipeline(KnownBoxes(GRID), Projective())
    assert not (pipeline.prepare(frame).workspace.objects & (frame.labels == 3)).any()
    assert (pipeline.prepare(frame, frame.labels > 0).workspace.objects & (frame.labels == 3)).any()


def test_ids_decide_which_pixels_are_one_object():
    """A box of one instance, without any edge, cut where only the mask says so."""
    frame = frame_of(CAMERA, ONE)
    halves = np.where(frame.labels > 0, 1 + (np.arange(320) > 150), 0)
    method = PartGuided(KnownBoxes(GRID, ONE), SeenParts(), GroupedByNetwork())
    pipeline = Pipeline(method, Projective(), samples=1)
    assert len(pipeline.estimate(frame).objects) == 1
    found = pipeline.complete(pipeline.prepare(frame, halves))
    assert len(found.objects) == 2
    sure = (found.masks > 0) & (halves > 0)
    assert sure.sum() > 0.9 * (halves > 0).sum()
    counts = [np.bincount(found.masks[sure & (halves == i)], minlength=3) for i in (1, 2)]
    left, right = (count.argmax() for count in counts)
    assert left != right
    assert all(count.max() > 0.97 * count.sum() for count in counts)  # by voxels near the table
    assert found.objects[0].pose.position[0] * found.objects[1].pose.position[0] < 0


def test_a_region_where_nothing_stands_is_one_line():
    with pytest.raises(InputError, match="that the mask covers them and that the depth scale"):
        Pipeline(KnownBoxes(GRID), Projective()).prepare(FRAME, FRAME.labels == 0)
