"""Views of one scene as one partial TSDF, and views that can't be of one scene."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import PartialTSDF, SceneParameters
from scenefw.core.errors import InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.mapping.several_views import fused, require_agreement, stacked
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.volumes import scene_volumes

GRID = GridSpec(resolution=32)


def box_at(x):
    """One box of 20 cm on the floor."""
    return SceneParameters(
        torch.full((1, 1, 3), 0.1),
        torch.full((1, 1, 3), 10.0),
        torch.eye(3)[None, None],
        torch.tensor([[[x, 0.0, 0.1]]]),
        torch.ones(1, 1, dtype=torch.bool),
    )


def seen(scene, *eyes):
    volume = scene_volumes(scene, GRID).tsdf
    views = []
    for eye in eyes:
        pose = look_at(np.array(eye), np.array([0.0, 0.0, 0.1]))
        cameras = stack_cameras([Camera(80, 60, 72.0, 72.0, 39.5, 29.5, pose)])
        depth = SphereTracer().render(volume, GRID, cameras)
        views.append(Projective().fuse(depth, GRID, cameras))
    return views


FRONT, BACK = (0.9, 0.0, 0.5), (-0.9, 0.0, 0.5)


def test_the_smaller_distance_wins_and_observations_add_up():
    views = seen(box_at(0.0), FRONT, BACK)
    both = fused(views, GRID)
    a, b = (view.distance.numpy() for view in views)
    assert np.array_equal(both.distance.numpy(), np.where(np.abs(a) <= np.abs(b), a, b))
    assert np.array_equal(both.observed, views[0].observed | views[1].observed)
    assert both.observed.sum() > 1.05 * views[0].observed.sum()
    assert fused(views[:1], GRID) is views[0]


def test_stacked_views_keep_images_and_cameras():
    views = seen(box_at(0.0), FRONT, BACK)
    batch = stacked(views)
    assert torch.equal(batch.depth[1], views[1].depth[0])
    assert torch.equal(batch.cameras.T_world_camera[1], views[1].cameras.T_world_camera[0])


def test_views_of_different_scenes_are_refused_in_one_line():
    good = seen(box_at(0.0), FRONT)[0]
    other = seen(box_at(0.3), (0.0, 0.9, 0.5))[0]
    with pytest.raises(InputError, match=r"views 1 and 2 contradict .*one world frame") as caught:
        require_agreement([good, other], GRID)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_used_is_told():
    with pytest.raises(InputError, match="no view"):
        fused([], GRID)
    (view,) = seen(box_at(0.0), FRONT)
    with pytest.raises(InputError, match="one grid"):
        fused([view], GridSpec(resolution=16))
    with pytest.raises(InputError, match="depth images"):
        stacked([replace(view, depth=None)])
    shapeless = PartialTSDF(view.distance, view.observed)
    assert fused([shapeless, shapeless], GRID).distance.shape == view.distance.shape
