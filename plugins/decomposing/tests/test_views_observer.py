"""Several depth images of one scene: which are used, and what they give."""

from dataclasses import replace

import numpy as np
import pytest
from plugins.decomposing.tests.several import fitted_parts
from tests.unit.perception.synthetic import STACK, camera_at, frame_of

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec
from scenefw_decomposing.same_surface import SurfaceOverlap
from scenefw_decomposing.whole_scenes import distant_views

CAMERAS = [
    camera_at(eye=(0.8 * np.cos(a), 0.8 * np.sin(a), 0.55)) for a in np.radians([0, 90, 200, 300])
]

HERE = np.eye(4)


def pipeline(overlap=None):
    return fitted_parts(overlap, GridSpec(resolution=64))


def frames(noise=0.0, world=HERE):
    return [
        replace(frame_of(camera, noise=noise, name=str(i)), camera=camera.moved(world @ pose))
        for i, (camera, pose) in enumerate((one, one.T_world_camera) for one in CAMERAS)
    ]


def test_boxes_are_found_at_their_size():
    found = pipeline(SurfaceOverlap()).estimate(frames(0.001))
    assert len(found.objects) == 2
    sizes = sorted(sorted(item.extents) for item in found.objects)
    wanted = sorted(sorted(np.subtract(box.upper, box.lower)) for box in STACK)
    np.testing.assert_allclose(sizes, wanted, atol=0.006)
    assert min(item.confidence for item in found.objects) > 0.95
    assert found.details["views"] == ["0", "1", "2", "3"]
    assert found.frame.depth.shape == found.masks.shape


TURNED = geometry.rotation_from_quaternion((0.9, 0.3, -0.2, 0.1))


@pytest.mark.parametrize(
    ("rotation", "place"),
    [(TURNED, (3.0, -2, 1)), (np.eye(3), (0, 0, -0.02))],
)  # fmt: skip
@pytest.mark.exhaustive
def test_poses_may_be_of_any_world(rotation, place):
    """Of one that is hardly off, too."""
    world = geometry.rigid(rotation, place)
    scene = pipeline().observe(frames(world=world))
    from_boxes = scene.T_views_input @ world  # from the boxes' own coordinates
    np.testing.assert_allclose(from_boxes[2], (0, 0, 1, 0), atol=2e-3)  # the floor is the floor
    assert scene.table == "found in the images"
    assert not scene.warnings


def test_poses_of_the_table_are_kept():
    scene = pipeline().observe(frames())
    np.testing.assert_allclose(scene.T_views_input[:3, :3], np.eye(3), atol=1e-9)
    assert scene.table == "the plane z = 0 of the poses"


def test_views_far_apart_are_chosen():
    poses = [geometry.rigid(np.eye(3), (x, 0, 0)) for x in (0, 0.01, 0.02, 1.0, 1.01, 0.5)]
    assert distant_views(poses, 3) == [0, 4, 5]
    assert distant_views(poses, 9) == [0, 1, 2, 3, 4, 5]
    assert distant_views([np.eye(4)] * 3, 9) == [0]


def test_a_bare_table_is_an_empty_scene_with_a_warning():
    bare = [replace(frame_of(camera, boxes=()), camera=camera) for camera in CAMERAS]
    estimate = pipeline().estimate(bare)
    assert estimate.objects == ()
    assert not estimate.instances.any()
    assert any(w.startswith("nothing stands on the floor") for w in estimate.details["warnings"])


def test_bad_views():
    with pytest.raises(InputError, match="there is no view"):
        pipeline().estimate([])
    good = frames()
    millimetres = [replace(good[0], depth=good[0].depth * 1000), *good[1:]]
    with pytest.raises(InputError, match="millimetres"):
        pipeline().estimate(millimetres)
    wrong = geometry.rigid(np.eye(3), (0.35, 0.0, 0.0))
    shifted = replace(good[1], camera=good[1].camera.moved(wrong @ CAMERAS[1].T_world_camera))
    with pytest.raises(InputError, match="contradict each other"):
        pipeline().estimate([good[0], shifted])
