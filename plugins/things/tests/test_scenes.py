"""Scenes of things are at rest, repeatable, stored as numbers, and each pixel has its class."""

import functools

import numpy as np
import pytest
import trimesh

from scenefw import registry
from scenefw.core.errors import ConfigError, StorageError
from scenefw_things.images.renderer import ThingRenderer
from scenefw_things.scenes.arrangements import box_about
from scenefw_things.scenes.cameras import HandheldCameras
from scenefw_things.scenes.generator import ThingScenes
from scenefw_things.scenes.physics import FastPhysics
from scenefw_things.scenes.scene import (
    BACKGROUND,
    OBJECT,
    OBSTACLE,
    SUPPORT,
    load_scenes,
    save_scenes,
)
from scenefw_things.scenes.surroundings import Surroundings
from scenefw_things.shapes.families import FAMILIES, OBSTACLES
from scenefw_things.shapes.thing import Thing

COUNT = 8


SHAPES = functools.cache(functools.partial(registry.build, "shape", "things"))


def source(**settings):
    crowded = Surroundings(edges=0.6, second=0.8, walls=0.8, standing=0.8, hanging=0.8)
    return ThingScenes(SHAPES(), FastPhysics(), crowded, **settings)


@pytest.fixture(scope="module")
def scenes():
    pytest.importorskip("pybullet")
    drawn = [source(maximum=8).generate(index, 3) for index in range(COUNT)]
    return [scene for scene in drawn if scene is not None]


def things(scene):
    return [item for item in scene.items if item.role == OBJECT]


def test_most_attempts_succeed(scenes):
    assert len(scenes) >= COUNT - 2
    assert all(2 <= len(things(scene)) <= 8 for scene in scenes)


def test_nothing_is_below_the_table_or_deep_in_another(scenes):
    for scene in scenes:
        for item in things(scene):
            low, _ = box_about(item.thing.parts, item.pose)
            assert low[2] > -0.02
        volumes = [_deepest(a, b) for a in things(scene) for b in things(scene) if a is not b]
        assert max(volumes, default=0) < 0.004


def _deepest(first, second):
    """How deep the corners of a thing lie in another (m)."""
    corners = np.concatenate([part.corners for part in first.thing.parts])
    world = corners @ first.pose.rotation.T + first.pose.position
    local = (world - second.pose.position) @ second.pose.rotation
    depths = [0.0]
    for normals, offsets in planes(second.thing):
        depths.append(float(-(local @ normals.T - offsets).max(axis=1).min()))
    return max(depths)


@functools.cache
def planes(thing):
    """Normals (N, 3) of each convex part's faces, and their distances (N,) from the origin."""
    hulls = [trimesh.convex.convex_hull(part.corners) for part in thing.parts]
    return [(hull.face_normals, np.einsum("ij,ij->i", hull.face_normals, hull.triangles[:, 0]))
            for hull in hulls]  # fmt: skip


def test_most_stay_where_they_are(scenes):
    shifts = []
    for scene in scenes:
        physics = FastPhysics(max_seconds=0.5)
        physics.begin(floor=scene.floor == 0)
        bodies = [physics.add(item.thing.parts, item.pose, fixed=item.role != OBJECT)
                  for item in scene.items]  # fmt: skip
        physics.settle()
        for body, item in zip(bodies, scene.items, strict=True):
            if item.role == OBJECT:
                after = physics.pose(body, item.thing.parts)
                shifts.append(np.linalg.norm(after.position - item.pose.position))
        physics.close()
    assert np.median(shifts) < 0.001
    assert np.mean(np.array(shifts) < 0.01) > 0.85


def test_obstacles_touch_no_thing(scenes):
    obstacles = [(scene, item) for scene in scenes for item in scene.items if item.role == OBSTACLE]
    assert len(obstacles) > COUNT
    for scene, item in obstacles:
        assert all(_deepest(thing, item) == 0 for thing in things(scene))


def test_same_seed_gives_the_same_scene(scenes):
    again = source(maximum=8).generate(scenes[1].index, 3)
    assert [item.thing for item in again.items] == [item.thing for item in scenes[1].items]
    for item, other in zip(again.items, scenes[1].items, strict=True):
        np.testing.assert_array_equal(item.pose.position, other.pose.position)


def test_scenes_are_rebuilt_bit_for_bit_from_a_file(scenes, tmp_path):
    again = load_scenes(save_scenes(tmp_path / "things.npz", scenes))
    camera = HandheldCameras(sizes=((64, 48),)).sample(np.random.default_rng(0), np.zeros(3), 0.2)
    for scene, other in zip(scenes[:2], again, strict=False):
        assert (scene.floor, scene.light, scene.split) == (other.floor, other.light, other.split)
        one, two = (ThingRenderer().images(s, [camera])[0] for s in (scene, other))
        np.testing.assert_array_equal(one.depth, two.depth)
        np.testing.assert_array_equal(one.colour, two.colour)
    assert len(again) == len(scenes)


def test_pixels_have_the_class_of_what_they_show(scenes):
    cameras = HandheldCameras(sizes=((96, 72),), fields=(50.0, 75.0), elevations=(40.0, 80.0))
    shown = set()
    for scene in scenes:
        camera = cameras.sample(np.random.default_rng(scene.index), np.zeros(3), 0.25)
        (image,) = ThingRenderer().images(scene, [camera])
        points = world_points(image)
        for number, item in enumerate(scene.items, start=1):
            mask = image.labels == number
            assert (image.classes[mask] == item.role).all()
            low, high = box_about(item.thing.parts, item.pose)
            assert (points[mask] > low - 2e-3).all()
            assert (points[mask] < high + 2e-3).all()
            assert item.thing.family in (
                OBSTACLES if item.role == OBSTACLE else FAMILIES | OBSTACLES
            )
        ground = (image.labels == 0) & (image.depth > 0)
        assert (np.abs(points[ground][:, 2] - scene.floor) < 2e-3).all()
        assert (image.classes[ground] == (SUPPORT if scene.floor == 0 else BACKGROUND)).all()
        np.testing.assert_array_equal(image.instances > 0, image.classes == OBJECT)
        shown |= set(np.unique(image.classes).tolist())
    assert {SUPPORT, OBSTACLE, OBJECT} <= shown


def world_points(image):
    """(H, W, 3) of pixels."""
    camera = image.camera
    v, u = np.mgrid[: camera.height, : camera.width]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)], -1)
    pose = camera.T_world_camera
    return (rays * image.depth[..., None]) @ pose[:3, :3].T + pose[:3, 3]


def test_splits_decide_the_families():
    pytest.importorskip("pybullet")
    for split in ("train", "final"):
        scene = next(
            filter(None, (source(maximum=6, split=split).generate(i, 0) for i in range(9)))
        )
        families = {item.thing.family for item in things(scene)}
        assert scene.split == split
        assert families <= set(SHAPES().families[split])


@pytest.mark.parametrize("name", ["robot_arm", "robot_gripper", "forearm", "crate"])
def test_what_is_no_thing_is_life_sized(name):
    pytest.importorskip("pybullet")
    middle = [sum(limits) / 2 for limits in OBSTACLES[name].limits.values()]
    sizes = np.ptp(
        np.concatenate([part.corners for part in Thing(name, tuple(middle), 1).parts]), 0
    )
    assert 0.15 < sizes.max() < 1.7


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"minimum": 5, "maximum": 3}, "expected 1 <= minimum"),
        ({"maximum": 500}, "maximum <= 60"),
        ({"arrangements": {"heap": 1.0}}, "expected numbers for pile"),
    ],
)
def test_wrong_numbers_are_told(settings, words):
    with pytest.raises(ConfigError, match=words):
        source(**settings)


def test_wrong_files_are_told(tmp_path):
    with pytest.raises(StorageError, match="make them with run=generate_things"):
        load_scenes(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", depth=np.zeros(3))
    with pytest.raises(StorageError, match="holds no scenes of things"):
        load_scenes(tmp_path / "other.npz")
    (tmp_path / "torn.npz").write_bytes(b"PK")
    with pytest.raises(StorageError, match="damaged"):
        load_scenes(tmp_path / "torn.npz")


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"distances": (2.0, 1.0)}, "expected the lower number first"),
        ({"elevations": (-5.0, 30.0)}, "expected 0 to 90 degrees"),
    ],
)
def test_wrong_cameras_are_told(settings, words):
    with pytest.raises(ConfigError, match=words):
        HandheldCameras(**{"sizes": [(64, 48)], **settings})


def test_cameras_keep_their_ranges():
    cameras = HandheldCameras([(64, 48)])
    rng = np.random.default_rng(1)
    middle = np.array([0.1, 0.0, 0.05])
    for _ in range(200):
        camera = cameras.sample(rng, middle, 0.2)
        eye = camera.T_world_camera[:3, 3]
        away = np.linalg.norm(eye - middle)
        assert 0.25 <= away <= 2.01
        assert np.rad2deg(np.arcsin((eye - middle)[2] / away)) >= 9.9
        field = np.rad2deg(2 * np.arctan(camera.width / 2 / camera.fx))
        assert 40.9 <= field <= 77.1
        np.testing.assert_allclose(np.linalg.det(camera.T_world_camera[:3, :3]), 1)
