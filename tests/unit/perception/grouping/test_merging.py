"""Parts joined where one superquadric explains them: drawn boxes and what they leave free."""

import numpy as np
import pytest
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import Frame, GridSpec
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceGathering
from scenefw.perception.grouping.merging import FitMerging
from scenefw.perception.grouping.segment_fits import SegmentFits
from scenefw.perception.observation.observation import JointGeometry
from scenefw.perception.observation.points import world_points

LONG = Box((-0.2, -0.04, 0.0), (0.2, 0.04, 0.08))
IN_FRONT = Box((-0.05, -0.16, 0.0), (0.05, -0.08, 0.2))


def merging(**changes):
    return FitMerging(SegmentFits(SuperquadricFit(), EvidenceGathering()), **changes)


def seen(boxes, resolution=48):
    """What a view of boxes says, their masks, and depth."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=(0.0, -0.9, 0.5))
    frame = frame_of(camera, boxes)
    points = world_points(Frame(frame.depth, camera))
    geometry = JointGeometry(points, grid, free(grid, camera, frame))
    return geometry, frame.labels, frame.depth


def free(grid, camera, frame):
    """Voxels in front of what their pixel shows."""
    centres = grid.centres()
    local = (centres - camera.T_world_camera[:3, 3]) @ camera.T_world_camera[:3, :3]
    u = np.rint(camera.fx * local[..., 0] / local[..., 2] + camera.cx).astype(int)
    v = np.rint(camera.fy * local[..., 1] / local[..., 2] + camera.cy).astype(int)
    inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    depth = frame.depth[np.clip(v, 0, camera.height - 1), np.clip(u, 0, camera.width - 1)]
    return inside & (local[..., 2] < depth - grid.voxel_size)


def cut(labels, label):
    """The object's visible pieces left and right of the middle as parts of their own."""
    columns = np.arange(labels.shape[1])[None]
    right = (labels == label) & (columns > labels.shape[1] / 2)
    return np.where(right, labels.max() + 1, labels).astype(np.int32)


@pytest.mark.parametrize("resolution", [32, 64])
def test_an_object_goes_on_behind_another(resolution):
    geometry, labels, depth = seen((LONG, IN_FRONT), resolution)
    parts = cut(labels, 1)
    assert len(np.unique(parts)) == 4
    found = merging().merge(parts, geometry, depth)
    np.testing.assert_array_equal(np.unique(found), [0, 1, 2])
    for label in (1, 2):
        assert len(np.unique(found[labels == label])) == 1
    assert ((found > 0) == (parts > 0)).all()


def test_two_objects_with_a_gap_stay_two():
    """The same pieces, but the view goes through between them."""
    left, right = Box(LONG.lower, (-0.04, 0.04, 0.08)), Box((0.04, -0.04, 0.0), LONG.upper)
    geometry, labels, depth = seen((left, right))
    np.testing.assert_array_equal(merging().merge(labels, geometry, depth), labels)


def test_objects_of_other_heights_behind_another_stay_two():
    left, right = Box(LONG.lower, (-0.02, 0.04, 0.16)), Box((0.02, -0.04, 0.0), LONG.upper)
    geometry, labels, depth = seen((left, right, IN_FRONT))
    np.testing.assert_array_equal(merging().merge(labels, geometry, depth), labels)


def test_few_pixels_and_none():
    geometry, labels, depth = seen((LONG,))
    parts = np.zeros_like(labels)
    assert (merging().merge(parts, geometry, depth) == 0).all()
    parts[labels > 0] = np.arange((labels > 0).sum()) // 10 + 1
    assert (merging(min_pixels=100).merge(parts, geometry, depth) == parts).all()


def test_a_sliver_of_what_an_object_hides_stays_apart():
    """However badly fits may explain both: no convex object hides a part of itself."""
    high, behind = (
        Box((-0.1, -0.1, 0.0), (0.1, 0.0, 0.3)),
        Box((0.06, 0.1, 0.0), (0.135, 0.2, 0.25)),
    )
    geometry, labels, depth = seen((high, behind))
    assert 30 <= (labels == 2).sum() < 0.1 * (labels == 1).sum()
    found = merging(max_deviation=1e6).merge(labels, geometry, depth)
    assert (found == labels).all()
    level = np.ones_like(depth)  # an image that does not say it
    assert found.max() > merging(max_deviation=1e6).merge(labels, geometry, level).max()


@pytest.mark.parametrize("wrong", [{"max_deviation": 0}, {"min_pixels": 0}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        merging(**wrong)


@pytest.mark.parametrize("between", [0.1, 0.4])
def test_small_parts_far_apart_stay_two(between):
    """One thin shape would explain both, but most of it lies where nothing of it is seen."""
    half = between / 2
    left = Box((-half - 0.04, -0.02, 0.0), (-half, 0.02, 0.04))
    right = Box((half, -0.02, 0.0), (half + 0.04, 0.02, 0.04))
    wall = Box((-half, -0.16, 0.0), (half, -0.08, 0.2))
    geometry, labels, depth = seen((left, right, wall))
    found = merging().merge(labels, geometry, depth)
    assert (found[labels == 1][0] == found[labels == 2][0]) == (between < 0.15)
