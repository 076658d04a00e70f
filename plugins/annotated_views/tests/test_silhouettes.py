"""Silhouettes and what is visible of them, against numbers found by hand."""

import numpy as np
import pytest
import trimesh

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, TriangleMesh
from scenefw_annotated_views.silhouettes import SolidViews


def box(low, high):
    made = trimesh.creation.box(bounds=[low, high])
    return TriangleMesh(np.array(made.vertices), np.array(made.faces, np.int64))


def from_above(cx=100.0, width=201):
    """2 m over the origin, x to the right."""
    pose = np.diag([1.0, -1, -1, 1])
    pose[2, 3] = 2
    return Camera(width, 161, 500.0, 500.0, cx, 80.0, pose)


CUBE = box([-0.1, -0.1, 0], [0.1, 0.1, 0.2])
"""Its top is 1.8 m away and covers +-27.8 pixels; its sides can't be seen from above."""
SLAB = box([0.01, -0.3, 0.25], [0.3, 0.3, 0.3])
"""It hides columns from 0.01 * 500 / 1.75 = 2.86 on."""


def test_what_a_slab_leaves_visible_of_a_cube():
    depth, (cube, slab) = SolidViews([CUBE, SLAB]).see(from_above())
    assert cube.pixels == cube.mask.sum() == 55 * 55
    assert cube.visible.sum() == 30 * 55
    assert cube.visibility == pytest.approx(30 / 55)
    assert cube.box == (73, 53, 127, 107)
    assert np.array_equal(slab.visible, slab.mask)
    assert depth[80, 80] == pytest.approx(1.8)
    assert depth[80, 110] == pytest.approx(1.7)
    assert depth[80, 50] == pytest.approx(2.0)


def test_what_lies_beyond_the_image_counts():
    _, (cube,) = SolidViews([CUBE]).see(from_above(cx=0.0))
    assert cube.mask.sum() == 28 * 55
    assert cube.pixels == 55 * 55
    assert cube.box == (-27, 53, 27, 107)
    assert cube.visibility == pytest.approx(28 / 55)
    _, (gone,) = SolidViews([CUBE]).see(from_above(cx=-100.0))
    assert not gone.mask.any()
    assert (gone.pixels, gone.visibility) == (55 * 55, 0)
    _, (far,) = SolidViews([CUBE]).see(from_above(cx=-1000.0))
    assert (far.pixels, far.box) == (0, None)


def test_behind_the_camera_and_around_it():
    camera = Camera(40, 30, 30.0, 30.0, 19.5, 14.5, look_at((1.0, 0, 0.1), (2.0, 0, 0.1)))
    depth, (behind, around) = SolidViews([CUBE, box([0.5, -1, 0], [1.5, 1, 1])]).see(camera)
    assert (behind.pixels, behind.box) == (0, None)
    assert around.mask.all()
    assert around.pixels == 90 * 120
    assert depth[15, 20] == pytest.approx(0.5)


def test_above_the_horizon_nothing_is_measured():
    camera = Camera(40, 30, 30.0, 30.0, 19.5, 14.5, look_at((1.0, 0, 0.5), (0.0, 0, 0.5)))
    depth, _ = SolidViews([]).see(camera)
    assert not depth[:15].any()
    assert depth[29, 20] == pytest.approx(0.5 * 30 / 14.5, rel=1e-5)
