"""Parts joined where one superquadric explains them: drawn boxes and what they leave free."""

import numpy as np
import pytest
from tests.unit.perception.synthetic import Box, camera_at, frame_of

from scenefw.core.errors import ConfigError
from scenefw.core.types import Frame, GridSpec
from scenefw.fitting.superquadrics import SuperquadricFit
from scenefw.perception.evidence.gathering import EvidenceOfView, View
from scenefw.perception.grouping.merging import GroupedByEvidence
from scenefw.perception.observation.points import world_points

LONG = Box((-0.2, -0.04, 0.0), (0.2, 0.04, 0.08))
IN_FRONT = Box((-0.05, -0.16, 0.0), (0.05, -0.08, 0.2))


def grouping(**changes):
    evidence = EvidenceOfView(seen=200, hidden=1, outside=100)
    return GroupedByEvidence(SuperquadricFit(), evidence, **changes)


def seen(boxes, resolution=48):
    """A view of boxes, their masks, and depth; no network says anything."""
    grid, camera = GridSpec(resolution=resolution), camera_at(eye=(0.0, -0.9, 0.5))
    frame = frame_of(camera, boxes)
    points = world_points(Frame(frame.depth, camera))
    nothing = np.zeros(grid.shape, np.int32)
    tsdf = np.full(grid.shape, grid.truncation, np.float32)
    view = View(points, np.zeros_like(frame.labels), tsdf, nothing, free(grid, camera, frame), grid)
    return view, frame.labels, frame.depth


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
    view, labels, depth = seen((LONG, IN_FRONT), resolution)
    parts = cut(labels, 1)
    assert len(np.unique(parts)) == 4
    found = grouping().objects(parts, view, depth)
    np.testing.assert_array_equal(np.unique(found), [0, 1, 2])
    for label in (1, 2):
        assert len(np.unique(found[labels == label])) == 1
    assert ((found > 0) == (parts > 0)).all()


def test_two_objects_with_a_gap_stay_two():
    """The same pieces, but the view goes through between them."""
    left, right = Box(LONG.lower, (-0.04, 0.04, 0.08)), Box((0.04, -0.04, 0.0), LONG.upper)
    view, labels, depth = seen((left, right))
    np.testing.assert_array_equal(grouping().objects(labels, view, depth), labels)


def test_objects_of_other_heights_behind_another_stay_two():
    left, right = Box(LONG.lower, (-0.02, 0.04, 0.16)), Box((0.02, -0.04, 0.0), LONG.upper)
    view, labels, depth = seen((left, right, IN_FRONT))
    np.testing.assert_array_equal(grouping().objects(labels, view, depth), labels)


def test_what_a_network_divides_wrongly_is_joined_again():
    view, labels, depth = seen((LONG,))
    shown = cut(labels, 1)
    view = View(view.points, shown, view.tsdf, view.instances, view.free, view.grid)
    np.testing.assert_array_equal(grouping().objects(labels, view, depth), labels)


def test_what_a_network_divides_rightly_stays_divided():
    """Two boxes side by side that the image alone doesn't separate."""
    view, labels, depth = seen(
        (Box((-0.2, -0.04, 0), (0, 0.04, 0.16)), Box((0, -0.04, 0), LONG.upper))
    )
    view = View(view.points, labels, view.tsdf, view.instances, view.free, view.grid)
    one = (labels > 0).astype(np.int32)
    found = grouping().objects(one, view, depth)
    assert len(np.unique(found)) == 3
    assert all(len(np.unique(found[labels == label])) == 1 for label in (1, 2))
    assert (grouping(divided=0.6).objects(one, view, depth) == one).all()


def test_few_pixels_and_none():
    view, labels, depth = seen((LONG,))
    parts = np.zeros_like(labels)
    assert (grouping().objects(parts, view, depth) == 0).all()
    parts[labels > 0] = np.arange((labels > 0).sum()) // 10 + 1
    assert (grouping(least=100).objects(parts, view, depth) == parts).all()


def test_a_sliver_of_what_an_object_hides_stays_apart():
    """However badly fits may explain both: no convex object hides a part of itself."""
    high, behind = (
        Box((-0.1, -0.1, 0.0), (0.1, 0.0, 0.3)),
        Box((0.06, 0.1, 0.0), (0.135, 0.2, 0.25)),
    )
    view, labels, depth = seen((high, behind))
    assert 30 <= (labels == 2).sum() < 0.1 * (labels == 1).sum()
    found = grouping(tolerance=1e6).objects(labels, view, depth)
    assert (found == labels).all()
    level = np.ones_like(depth)  # an image that does not say it
    assert found.max() > grouping(tolerance=1e6).objects(labels, view, level).max()


@pytest.mark.parametrize("wrong", [{"tolerance": 0}, {"least": 0}, {"divided": 0}])
def test_wrong_numbers_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        grouping(**wrong)


@pytest.mark.parametrize("between", [0.1, 0.4])
def test_small_parts_far_apart_stay_two(between):
    """One thin shape would explain both, but most of it lies where nothing of it is seen."""
    half = between / 2
    left = Box((-half - 0.04, -0.02, 0.0), (-half, 0.02, 0.04))
    right = Box((half, -0.02, 0.0), (half + 0.04, 0.02, 0.04))
    wall = Box((-half, -0.16, 0.0), (half, -0.08, 0.2))
    view, labels, depth = seen((left, right, wall))
    found = grouping().objects(labels, view, depth)
    assert (found[labels == 1][0] == found[labels == 2][0]) == (between < 0.15)
