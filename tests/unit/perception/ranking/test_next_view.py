from dataclasses import replace

import numpy as np
import pytest
from tests.unit.perception.edited_scenes import scene

from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.perception.ranking.next_view import next_views, views_around

MIDDLE = np.array([0.0, 0.0, 0.05])
FRONT, BACK = (look_at(np.array([0.0, y, 0.4]), MIDDLE) for y in (-0.8, 0.8))


def scenes_of(*depths):
    """A box that goes back to different depths (m): the camera sees its front."""
    made = scene()
    x, y, z = np.moveaxis(made.grid.centres(), -1, 0)
    volumes = []
    for depth in depths:
        solid = (abs(x) < 0.15) & (y > -0.15) & (y < depth) & (z > 0) & (z < 0.2)
        volumes.append(np.where(solid, -0.02, 0.02).astype(np.float32))
    return [replace(made, tsdf=volume) for volume in volumes]


def test_a_view_from_behind_tells_how_far_back_a_box_goes():
    best, worst = next_views(scenes_of(0.05, 0.15), [FRONT, BACK])
    assert best.T_world_camera is BACK or np.array_equal(best.T_world_camera, BACK)
    assert best.score > 2 * worst.score
    assert 0 <= worst.score <= best.score <= 1
    assert best.volume > worst.volume


def test_what_a_camera_looks_away_from_tells_nothing():
    away = look_at(np.array([0.0, -0.8, 0.4]), np.array([0.0, -2.0, 0.4]))
    (view,) = next_views(scenes_of(0.05, 0.15), [away])
    assert view.score == view.volume == 0


def test_hypotheses_that_agree_leave_nothing_to_tell():
    assert next_views(scenes_of(0.1, 0.1), [FRONT])[0].score == 0
    assert next_views(scenes_of(0.1), [FRONT])[0].score == 0


def test_free_space_all_around_is_reached_as_far_as_the_image_goes():
    """Of a voxel that one hypothesis fills and nothing hides, every view from above tells."""
    first, second = scenes_of(-0.15, -0.15)
    x, y, z = np.moveaxis(first.grid.centres(), -1, 0)
    alone = (abs(x) < 0.02) & (abs(y) < 0.02) & (abs(z - 0.1) < 0.02)
    second = replace(second, tsdf=np.where(alone, -0.02, 0.02).astype(np.float32))
    views = next_views([first, second], [FRONT, BACK])
    assert all(view.score > 0.9 for view in views)


def test_sampled_views_look_at_the_objects_from_all_sides():
    made = scene()
    poses = views_around(made, 40)
    points = np.concatenate([item.mesh.vertices for item in made.objects])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = np.linalg.norm(made.frame.camera.T_world_camera[:3, 3] - middle)
    eyes = np.array([pose[:3, 3] - middle for pose in poses])
    np.testing.assert_allclose(np.linalg.norm(eyes, axis=1), distance)
    for pose, eye in zip(poses, eyes, strict=True):
        np.testing.assert_allclose(pose[:3, 2], -eye / distance, atol=1e-9)
    quadrants = {(x > 0, y > 0) for x, y, _ in eyes}
    assert len(quadrants) == 4
    assert len(views_around(replace(made, objects=()), 5)) == 5


@pytest.mark.parametrize("poses", [[], [np.eye(3)]])
def test_poses_that_are_none_are_said(poses):
    with pytest.raises(InputError, match="4 x 4"):
        next_views(scenes_of(0.1, 0.2), poses)
