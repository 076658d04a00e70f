"""Hulls of visible points, against boxes that are seen from one side."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from scenefw.core.types import Camera, Frame
from scenefw.perception.observation.observation import Observation
from scenefw.shapes.moments import moments
from scenefw.shapes.superquadric import Superquadric
from scenefw_annotated_views.silhouettes import SolidViews
from scenefw_single_view_benchmarks.shape_methods import VisibleHulls, with_mirror_images

EYE = np.array([0.0, -1.0, 0.5])


def test_the_mirror_images_of_two_sides_fill_a_box():
    across, up = np.meshgrid(np.linspace(-0.04, 0.04, 9), np.linspace(0, 0.1, 9))
    front = np.stack([across, np.full_like(up, -0.03), up], axis=-1).reshape(-1, 3)
    x, y = np.meshgrid(np.linspace(-0.04, 0.04, 9), np.linspace(-0.03, 0.03, 9))
    top = np.stack([x, y, np.full_like(x, 0.1)], axis=-1).reshape(-1, 3)
    points = with_mirror_images(np.concatenate([front, top]), EYE)
    assert ConvexHull(points).volume == pytest.approx(0.08 * 0.06 * 0.1)


def test_from_above_nothing_is_behind():
    points = np.random.default_rng(0).uniform(-0.1, 0.1, (50, 3))
    above = points.mean(axis=0) + (0, 0, 1)
    np.testing.assert_allclose(with_mirror_images(points, above), np.tile(points, (2, 1)))


class Everything:
    """One segment: all that rises above the floor."""

    def segment(self, view):
        return (view.points[..., 2] > 0.003).astype(np.int32)


def above(height=0.8):
    pose = np.diag([1.0, -1, -1, 1])
    pose[2, 3] = height
    return Camera(160, 120, 145, 145, 79.5, 59.5, pose)


@pytest.mark.parametrize("mirror", [False, True])
def test_marked_and_segmented_objects_have_hulls(mirror):
    shape = Superquadric([0.05, 0.04, 0.03], [9, 9, 9]).mesh(12)
    box = type(shape)(shape.vertices + (0, 0, 0.03), shape.faces)
    depth, (silhouette,) = SolidViews([box]).see(above())
    frame = Frame(depth, above())
    view = Observation(frame)
    method = VisibleHulls(Everything(), mirror=mirror)
    scene = method.scene(view)
    (item,) = scene.objects
    assert moments(item.mesh).volume == pytest.approx(moments(box).volume, rel=0.1)
    assert (scene.masks > 0).sum() == pytest.approx(silhouette.visible.sum(), rel=0.05)
    marked = Observation(frame, masks=silhouette.visible.astype(np.int32), ids=(7,))
    scene = method.scene(marked)
    assert [item.id for item in scene.objects] == [7]
    assert set(np.unique(scene.masks)) == {0, 7}
    np.testing.assert_array_equal(scene.camera.T_world_camera, above().T_world_camera)
