"""Complete volumes taken apart by views from all sides."""

import numpy as np
import pytest
import torch
from plugins.decomposing.tests.several import PAIR, fitted_parts

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw.mapping.inverse_ray_tracing import InverseRayTracing
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw_decomposing.all_sides import AllSides, ball, spread
from scenefw_decomposing.surround import SurroundingCameras


def volume(grid):
    """Truncated distances of the pair of boxes, by their formula, and which box is nearer."""
    fields = []
    for sides, place in PAIR:
        away = np.abs(grid.centres() - place) - np.asarray(sides) / 2
        outside = np.linalg.norm(away.clip(min=0), axis=-1)
        fields.append(outside + away.max(axis=-1).clip(max=0))
    both = np.stack(fields)
    tsdf = both.min(axis=0).clip(-grid.truncation, grid.truncation)
    labels = np.where(tsdf < 0, both.argmin(axis=0) + 1, 0)
    return torch.from_numpy(tsdf.astype(np.float32))[None, None], labels


def method(ring=4):
    cameras = SurroundingCameras(320, 240, ring=ring)
    return AllSides(fitted_parts(), cameras, SphereTracer(), InverseRayTracing())


def test_boxes_on_each_other_are_two_objects():
    grid = GridSpec(resolution=48)
    tsdf, true = volume(grid)
    found = method().decompose(tsdf, grid, torch.Generator())
    labels = found.instances[0].numpy()
    assert set(np.unique(labels)) == {0, 1, 2}
    np.testing.assert_array_equal(labels > 0, true > 0)  # what is inside stays what it was
    torch.testing.assert_close(found.tsdf[0], tsdf[0, 0])
    for box in (1, 2):
        overlaps = [
            ((labels == one) & (true == box)).sum() / ((labels == one) | (true == box)).sum()
            for one in (1, 2)
        ]
        assert max(overlaps) > 0.85  # a layer of voxels more or less where they meet


def test_an_empty_volume_is_one_line():
    grid = GridSpec(resolution=16)
    empty = torch.full((1, 1, *grid.shape), grid.truncation)
    with pytest.raises(InputError, match="the volume is empty"):
        method().decompose(empty, grid, torch.Generator())


def test_labels_spread_inside_alone():
    labels = np.zeros((5, 1, 1), np.int32)
    labels[1], labels[4] = 7, 2
    inside = np.array([True, True, True, False, True])[:, None, None]
    assert spread(labels, inside).ravel().tolist() == [7, 7, 7, 0, 2]
    assert not spread(np.zeros_like(labels), inside).any()


def test_the_ball_holds_all_voxels():
    grid = GridSpec(resolution=20)
    occupied = np.random.default_rng(0).random(grid.shape) > 0.999
    centre, radius = ball(occupied, grid)
    away = np.linalg.norm(grid.centres()[occupied] - centre, axis=-1)
    assert away.max() + grid.voxel_size / 2 < radius
