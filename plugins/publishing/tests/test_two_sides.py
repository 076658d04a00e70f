import numpy as np
import pytest
from tests.unit.report.test_overview import estimate_of

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera
from scenefw.report.surfaces import Surfaces
from scenefw_publishing.two_sides import draw_two_sides, of_objects, seen_share


@pytest.mark.parametrize("eye", [(0, -0.9, 0.6), (0.9, 0.1, 0.4)])
def test_of_a_ball_the_half_before_the_camera_is_seen(eye):
    estimate = estimate_of(resolution=48)
    grid = estimate.grid
    camera = Camera(320, 240, 360.0, 360.0, 159.5, 119.5, look_at(eye, (0, 0, 0.1)))
    surfaces = Surfaces({item.id: item.mesh for item in estimate.objects})
    share = seen_share(estimate, estimate.tsdf, surfaces, camera)
    outward = grid.centres() - (0, 0, 0.12)
    to_eye = np.array(eye) - grid.centres()
    cosine = (outward * to_eye).sum(axis=-1) / np.maximum(
        np.linalg.norm(outward, axis=-1) * np.linalg.norm(to_eye, axis=-1), 1e-9
    )
    surface = np.abs(estimate.tsdf) < grid.voxel_size / 2
    assert share[surface & (cosine > 0.4)].min() > 0.7
    assert share[surface & (cosine < -0.6)].max() < 0.3


def test_dips_that_are_no_object_are_lifted():
    estimate = estimate_of()
    dented = estimate.tsdf.copy()
    dented[2:5, 2:5, 2:5] = -0.01
    lifted = of_objects(type(estimate)(**{**vars(estimate), "tsdf": dented}))
    assert lifted[2:5, 2:5, 2:5].min() > 2 * estimate.grid.voxel_size
    inside = estimate.instances > 0
    np.testing.assert_array_equal(lifted[inside], estimate.tsdf[inside])
    found = of_objects(estimate)
    near = np.abs(np.minimum(found, estimate.grid.truncation) - estimate.tsdf)
    assert near.max() < 1.01 * estimate.grid.voxel_size
    exact = np.linalg.norm(estimate.grid.centres() - (0, 0, 0.12), axis=-1) - 0.12
    assert np.abs(found - exact).max() < 1.5 * estimate.grid.voxel_size  # far from the ball too


def test_the_picture_shows_both_sides_the_hidden_one_paler():
    picture = draw_two_sides(estimate_of())
    height, width = picture.shape[:2]
    assert (height, width) == (330, 888)
    assert 0 <= picture.min() <= picture.max() <= 1
    colourful = np.ptp(picture, axis=-1)
    left, right = colourful[:, : width // 2], colourful[:, width // 2 :]
    for half in (left, right):
        assert 0.02 < (half > 0.15).mean() < 0.6
    assert np.percentile(left[left > 0.15], 90) > np.percentile(right[right > 0.15], 50) + 0.1


def test_a_scene_without_objects_is_floor():
    assert np.ptp(draw_two_sides(estimate_of(objects=0)), axis=-1).max() < 0.1
