"""What happens to boxes of known places, in images with noise."""

from dataclasses import replace

import numpy as np
import pytest
from plugins.tracking.tests.moving_boxes import CROWD, box, camera, image, pipeline

from scenefw.core.errors import InputError
from scenefw.core.geometry import transform_points
from scenefw.perception.estimate.base_frame import TRACKS
from scenefw_tracking.changes import CHANGED
from scenefw_tracking.tracker import Tracker

HAND = box(-0.2, -0.04, (0.13, 0.14, 0.25))
"""Stands in front of the first box, of which nothing is visible."""


class Counting:
    """A pipeline that counts what it is asked for."""

    def __init__(self, inner):
        self.inner, self.segmentation = inner, inner.segmentation
        self.observed = 0
        self.regions = []

    def observe(self, frame, mask=None):
        self.observed += 1
        return self.inner.observe(frame, mask)

    def reconstruct(self, view, **options):
        self.regions.append(options["regions"])
        return self.inner.reconstruct(view, **options)


def tracked(scenes, width=320, samples=1):
    """What a tracker says of images of boxes, and the pipeline that it asked."""
    counting = Counting(pipeline(samples))
    tracker = Tracker(counting)
    seen_by = camera(width)
    return [tracker.track(image(boxes, i, seen_by)) for i, boxes in enumerate(scenes)], counting


def states(scene):
    return {label: (str(track.state), track.since) for label, track in scene.tracks.items()}


def id_at(scene, x, y):
    """Id of the object whose middle is nearest to a place of the table, in the true world."""
    first = scene.frame.camera.T_world_camera
    place = transform_points(
        first @ np.linalg.inv(camera().T_world_camera), np.array([[x, y, 0.03]])
    )
    items = scene.scenes[0].objects
    distances = [np.linalg.norm(item.pose.position - place[0]) for item in items]
    assert min(distances) < 0.04
    return items[int(np.argmin(distances))].id


@pytest.fixture(scope="module")
def sequence():
    """Still; one added; the first moved by (0.06, -0.05); the second taken away; still."""
    added = (*CROWD, box(0.05, -0.15, (0.05, 0.12, 0.04)))
    shifted = (box(-0.14, -0.05), *added[1:])
    taken = (shifted[0], *shifted[2:])
    return tracked([CROWD, CROWD, added, shifted, taken, taken], samples=2)


def test_an_unchanged_scene_is_not_looked_at_again(sequence):
    scenes, counting = sequence
    first, second = scenes[:2]
    assert set(states(first).values()) == {("new", "image_0")}
    assert set(states(second).values()) == {("still", "image_0")}
    for before, after in zip(first.scenes, second.scenes, strict=True):
        assert after.objects is before.objects
        assert after.tsdf is before.tsdf
        assert after.masks is before.masks
        assert after.frame.name == "image_1"
    assert counting.observed == 4  # not of the second image, nor of the last


def test_an_object_that_is_added_gets_a_new_id_and_the_others_stay(sequence):
    (_, before, after, *_), counting = sequence
    new = id_at(after, 0.05, -0.15)
    assert states(after)[new] == ("new", "image_2")
    assert new not in states(before)
    items = {item.id: item for item in after.scenes[0].objects}
    for item in before.scenes[0].objects:
        assert items[item.id] is item
        assert states(after)[item.id] == ("still", "image_0")
    regions = counting.regions[1]
    assert np.mean(regions[after.scenes[0].masks == new] == CHANGED) > 0.9
    assert not (regions[before.scenes[0].masks > 0] == CHANGED).any()


def test_an_object_that_moves_keeps_its_id_and_tells_its_motion(sequence):
    (_, _, before, after, *_), _ = sequence
    label = id_at(before, -0.2, 0.0)
    assert id_at(after, -0.14, -0.05) == label
    assert states(after)[label] == ("moved", "image_3")
    facts = next(f for f in after.scenes[0].details[TRACKS] if f["id"] == label)
    items = [
        next(item for item in scene.scenes[0].objects if item.id == label)
        for scene in (before, after)
    ]
    motion = np.array(facts["motion"])
    moved_to = transform_points(motion, items[0].pose.position[None])[0]
    np.testing.assert_allclose(moved_to, items[1].pose.position, atol=0.015)
    assert np.linalg.norm(moved_to - items[0].pose.position) == pytest.approx(0.078, abs=0.015)
    others = {k: v for k, v in states(after).items() if k != label}
    assert {state for state, _ in others.values()} == {"still"}


def test_an_object_that_is_taken_away_is_gone_everywhere(sequence):
    (*_, before, after, last), _ = sequence
    label = id_at(before, 0.0, 0.02)
    for scene in (after, last):
        assert states(scene)[label] == ("gone", "image_4")
        for estimate in scene.scenes:
            assert label not in [item.id for item in estimate.objects]
            assert not (estimate.masks == label).any()
            assert not (estimate.instances == label).any()
    moved = id_at(last, -0.14, -0.05)
    assert states(last)[moved] == ("still", "image_3")


def test_masks_and_volumes_hold_all_objects(sequence):
    for scene in sequence[0]:
        for estimate in scene.scenes:
            ids = {item.id for item in estimate.objects}
            assert set(np.unique(estimate.instances)) - {0} == ids
            assert set(np.unique(estimate.masks)) - {0} == ids
            assert estimate.masks.shape == scene.frame.depth.shape


def test_an_object_behind_a_hand_stays_and_comes_back():
    (before, during, after), _ = tracked([CROWD, (*CROWD, HAND), CROWD])
    label = id_at(before, -0.2, 0.0)
    item = next(item for item in before.scenes[0].objects if item.id == label)
    assert states(during)[label] == ("hidden", "image_1")
    assert not (during.scenes[0].masks == label).any()
    assert states(after)[label] == ("still", "image_0")
    for scene in (during, after):
        assert item in scene.scenes[0].objects
    np.testing.assert_array_equal(after.scenes[0].masks, before.scenes[0].masks)
    (hand,) = states(during).keys() - states(before).keys()
    assert states(after)[hand] == ("gone", "image_2")


def test_an_object_that_comes_back_has_its_id():
    scenes, _ = tracked([CROWD, CROWD[1:], CROWD])
    label = id_at(scenes[0], -0.2, 0.0)
    assert states(scenes[1])[label] == ("gone", "image_1")
    assert states(scenes[2])[label] == ("still", "image_2")


def test_an_object_may_be_put_onto_one_that_stands_still():
    upper = box(0.0, 0.02, (0.06, 0.06, 0.05), 0.05)
    (before, after), _ = tracked([CROWD, (*CROWD, upper)])
    (label,) = states(after).keys() - states(before).keys()
    item = next(item for item in after.scenes[0].objects if item.id == label)
    assert item.mesh.vertices[:, 2].min() > 0.03  # not down to the table
    lower = next(i for i in before.scenes[0].objects if i.id == id_at(before, 0.0, 0.02))
    assert lower in after.scenes[0].objects
    assert states(after)[lower.id] == ("still", "image_0")


def test_an_object_that_is_pushed_a_little_does_not_lose_a_piece():
    """By 1 cm away from the camera: little of it is where it was not, and nothing is free."""
    pushed = (CROWD[0], box(0.0, 0.03, (0.1, 0.1, 0.05)), CROWD[2])
    (before, after), _ = tracked([CROWD, pushed], 640)
    assert states(after).keys() == states(before).keys()
    label = id_at(after, 0.0, 0.03)
    items = [next(i for i in s.scenes[0].objects if i.id == label) for s in (before, after)]
    assert np.ptp(items[1].mesh.vertices, axis=0).max() < 0.16  # from corner to corner
    assert states(after)[label][0] in ("still", "moved")


def test_a_camera_that_moves_finds_objects_again_by_its_pose():
    cameras = [camera(), replace(camera(), T_world_camera=_turned(camera().T_world_camera))]
    tracker = Tracker(pipeline(samples=1))
    shifted = (*CROWD[:2], box(0.1, -0.1, (0.04, 0.12, 0.12)))
    first, second, third = (
        tracker.track(image(boxes, i, seen_by), None, seen_by.T_world_camera)
        for i, (boxes, seen_by) in enumerate(
            [(CROWD, cameras[0]), (CROWD, cameras[1]), (shifted, cameras[0])]
        )
    )
    for x, y in ((-0.2, 0.0), (0.0, 0.02), (0.18, 0.1)):
        label = id_at(first, x, y)
        item, again = (
            next(item for item in scene.scenes[0].objects if item.id == label)
            for scene in (first, second)
        )
        np.testing.assert_allclose(again.pose.position, item.pose.position, atol=0.03)
    assert len(second.tracks) == 3
    assert states(third)[id_at(first, 0.18, 0.1)] == ("moved", "image_2")


def test_a_table_may_be_bare_before_and_after():
    (bare, full, again), _ = tracked([(), CROWD, ()])
    assert bare.tracks == {}
    assert set(states(full).values()) == {("new", "image_1")}
    assert len(full.scenes[0].objects) == 3
    assert set(states(again).values()) == {("gone", "image_2")}
    assert again.scenes[0].objects == ()
    assert not (again.scenes[0].tsdf < 0).any()


def test_poses_that_tremble_add_up_to_a_motion():
    """By a twentieth of a pixel each: no image is looked at anew until it is one of them."""
    counting = Counting(pipeline(samples=1))
    tracker = Tracker(counting)
    poses = [camera().T_world_camera.copy() for _ in range(4)]
    for number, pose in enumerate(poses):
        pose[0, 3] += 0.00015 * number
        tracker.track(image(CROWD, number), None, pose)
    assert counting.observed == 1
    far = camera().T_world_camera.copy()
    far[0, 3] += 0.02
    moved = image(CROWD, 4, replace(camera(), T_world_camera=far))
    scene = tracker.track(moved, None, far)
    assert counting.observed == 2
    shift = scene.frame.camera.T_world_camera @ np.linalg.inv(far)
    first = tracker.track(image(CROWD, 5), None, camera().T_world_camera)
    again = first.frame.camera.T_world_camera @ np.linalg.inv(camera().T_world_camera)
    np.testing.assert_allclose(again, shift, atol=1e-6)


def test_a_camera_that_moves_without_poses_is_told():
    """Also if it moves around the table, whose depth stays the same."""
    elsewhere = replace(camera(), T_world_camera=_turned(camera().T_world_camera))
    tracker = Tracker(pipeline(samples=1))
    tracker.track(image(CROWD, 0))
    scene = tracker.track(image(CROWD, 1, elsewhere))
    assert [w for w in scene.warnings if w.startswith("most has changed")]
    assert len(scene.scenes[0].objects) == 3


def test_unusable_images_are_refused_and_change_nothing():
    counting = Counting(pipeline(samples=1))
    tracker = Tracker(counting)
    tracker.track(image(CROWD, 0))
    other = image(CROWD, 1, camera(160))
    with pytest.raises(InputError, match="image_1 is 160 x 120, but the images before are 320 x"):
        tracker.track(other)
    sharper = replace(other.camera, width=320, height=240)
    with pytest.raises(InputError, match="other intrinsics than the images before"):
        tracker.track(replace(image(CROWD, 1), camera=sharper))
    with pytest.raises(InputError, match="camera_pose is given for some of the images"):
        tracker.track(image(CROWD, 1), None, np.eye(4))
    with pytest.raises(InputError, match="masks of two values"):
        tracker.track(image(CROWD, 1), np.ones((240, 320), np.int32))
    scene = tracker.track(image(CROWD, 2))
    assert set(states(scene).values()) == {("still", "image_0")}
    assert counting.observed == 1


def _turned(pose, angle=0.2):
    """A camera's pose after it went around the middle of the table."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.eye(4)
    turn[:2, :2] = [[c, -s], [s, c]]
    return turn @ pose
