"""Regions of depth images, and creases of analytic surfaces."""

import heapq

import numpy as np
import pytest

from scenefw.core.types import Camera, Frame
from scenefw.perception.segmentation.regions import (
    along_borders,
    concave_creases,
    grown,
    hiding,
    large_parts,
)


def folded(angle, width=80, height=60):
    """Two planes that meet in a vertical line at the middle; angle > 0 bends towards the camera."""
    camera = Camera(width, height, 100.0, 100.0, (width - 1) / 2, (height - 1) / 2)
    x = (np.arange(width) - camera.cx) / camera.fx
    slope = np.tan(np.radians(angle) / 2)
    # a point on the ray x z lies on the fold where z = 1 - slope |x z|
    depth = np.tile(1 / (1 + slope * np.abs(x)), (height, 1))
    return Frame(depth.astype(np.float32), camera)


@pytest.mark.parametrize("size", [(80, 60), (160, 120)])
def test_only_folds_towards_the_camera_are_creases(size):
    valley = concave_creases(folded(40, *size), np.cos(np.radians(25)), 3)
    columns = np.flatnonzero(valley.any(axis=0))
    assert len(columns) > 0
    assert abs(columns - (size[0] - 1) / 2).max() < 3.5
    assert not concave_creases(folded(-40, *size), np.cos(np.radians(25)), 3).any()
    assert not concave_creases(folded(20, *size), np.cos(np.radians(25)), 3).any()


def test_pixels_without_depth_are_no_creases():
    frame = folded(-40)
    frame.depth[20:40, 30:50] = 0
    assert not concave_creases(frame, np.cos(np.radians(25)), 3).any()


def walked(labels, among, depth, furthest=np.inf):
    """Least costs from any pixel of each label (K, H, W), by plain Dijkstra."""
    found = []
    for label in range(1, labels.max() + 1):
        costs = np.where(labels == label, 0.0, np.inf)
        queue = [(0.0, *place) for place in zip(*np.nonzero(labels == label), strict=True)]
        heapq.heapify(queue)
        while queue:
            cost, y, x = heapq.heappop(queue)
            for near in ((y + 1, x), (y - 1, x), (y, x + 1), (y, x - 1)):
                inside = 0 <= near[0] < depth.shape[0] and 0 <= near[1] < depth.shape[1]
                if not inside or not among[near] or labels[near]:
                    continue
                rise = abs(float(depth[near]) - float(depth[y, x]))
                if rise > furthest:
                    continue
                longer = cost + 1 + 1000 * max(rise - 0.002, 0)
                if longer < costs[near]:
                    costs[near] = longer
                    heapq.heappush(queue, (longer, *near))
        found.append(costs)
    return np.stack(found)


@pytest.mark.parametrize("furthest", [np.inf, 0.01])
@pytest.mark.parametrize("seed", range(4))
def test_labels_grow_along_the_surface(seed, furthest):
    rng = np.random.default_rng(seed)
    depth = rng.choice([1.0, 1.003, 1.02], (14, 19)).astype(np.float32)
    among = rng.random(depth.shape) < 0.85
    labels = np.where(among & (rng.random(depth.shape) < 0.04), rng.integers(1, 4, depth.shape), 0)
    found = grown(labels.astype(np.int32), among, depth, furthest)
    costs = walked(labels, among, depth, furthest)
    assert (found[labels > 0] == labels[labels > 0]).all()
    reached = np.isfinite(costs).any(axis=0)
    assert ((found > 0) == reached).all()
    own = np.take_along_axis(costs, np.maximum(found - 1, 0)[None].astype(int), axis=0)[0]
    np.testing.assert_allclose(own[reached], costs.min(axis=0)[reached], rtol=1e-3)


@pytest.mark.parametrize(
    ("further", "hides"),
    [
        ([0.06] * 10, True),
        ([0.02] * 10, False),
        ([0.06] * 9 + [0.0], True),  # a pixel between two surfaces
        ([0.06] * 8 + [0.0] * 2, False),  # it goes on behind at one end, as a handle does
    ],
)
def test_one_part_hides_another_where_depth_jumps_along_their_border(further, hides):
    parts = np.zeros((10, 8), np.int32)
    parts[:, :4], parts[:, 4:7] = 2, 3
    depth = np.ones((10, 8), np.float32)
    depth[:, 4:] += np.array(further, np.float32)[:, None]
    found = hiding(parts, depth)
    assert found.shape == (4, 4)
    assert (found == found.T).all()
    assert found[2, 3] == hides
    assert not found[[0, 1]].any()  # the floor hides nothing, and nobody has label 1
    assert not hiding(np.where(parts == 3, 0, parts), depth).any()


def test_borders_are_counted_once():
    parts = np.array([[1, 2, 0], [3, 2, 0]], np.int32).repeat(5, axis=0).repeat(5, axis=1)
    across = np.arange(10.0)[:, None].repeat(14, axis=1)
    sums, lengths = along_borders(parts, across, np.full((9, 15), 0.5))
    assert lengths[1, 2] == lengths[2, 1] == 5
    assert lengths[2, 3] == lengths[1, 3] == 5
    assert (sums[1, 2], sums[2, 3], sums[3, 1]) == (10, 35, 2.5)
    assert not lengths[0].any()


def test_nothing_grows_from_nothing():
    depth = np.ones((5, 6), np.float32)
    nothing = np.zeros((5, 6), np.int32)
    assert not grown(nothing, depth > 0, depth).any()


def test_small_components_become_background():
    components = np.array([[1, 1, 2], [0, 3, 3]])
    np.testing.assert_array_equal(large_parts(components, 2), [[1, 1, 0], [0, 2, 2]])
