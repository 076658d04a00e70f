"""Stored images of scenes of things: a scene made by hand, and what a training reads of it."""

import json

import numpy as np
import pytest

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.types import Pose
from scenefw_things.images.renderer import ThingRenderer
from scenefw_things.images.stored_images import DEPTH_UNIT, OBSTACLE, StoredImages
from scenefw_things.render import RenderThings
from scenefw_things.scenes.cameras import HandheldCameras
from scenefw_things.scenes.scene import OBJECT, ThingItem, ThingScene, save_scenes
from scenefw_things.scenes.scene import OBSTACLE as IS_OBSTACLE
from scenefw_things.shapes.families import FAMILIES, OBSTACLES
from scenefw_things.shapes.thing import Thing


def item(families, name, position, role, seed):
    middle = tuple(float(np.float32(sum(limits) / 2)) for limits in families[name].limits.values())
    pose = Pose(np.array(position), np.array([1.0, 0, 0, 0]))
    return ThingItem(Thing(name, middle, seed), pose, role, seed)


def scene(index, split):
    items = (
        item(FAMILIES, "book", (0.0, 0.0, 0.0), OBJECT, 1),
        item(FAMILIES, "can", (0.25, 0.0, 0.0), OBJECT, 2),
        item(OBSTACLES, "crate", (0.0, 0.5, 0.0), IS_OBSTACLE, 3),
    )
    return ThingScene(items, 0.0, 5, index, 0, split)


@pytest.fixture
def scenes(tmp_path):
    return save_scenes(tmp_path / "things.npz", [scene(0, "train"), scene(1, "val")])


def task(scenes, folder, size=(96, 72), views=2, **settings):
    cameras = HandheldCameras(
        distances=(0.9, 1.2), elevations=(50, 70), fields=(60, 70), sizes=[size], upright=1.0
    )
    return RenderThings(scenes, cameras, ThingRenderer(), views, 0, folder, **settings)


@pytest.mark.parametrize("size", [(96, 72), (64, 80)])
def test_depth_and_owners_agree_with_the_scene(scenes, tmp_path, size):
    assert task(scenes, tmp_path / "images", size).run() == {"train": 2.0, "val": 2.0}
    images = StoredImages.open(tmp_path / "images/train")
    assert images.size == size
    assert len(images) == 2
    assert {1, 2} <= set(np.unique(images.owners)) <= {0, 1, 2, OBSTACLE + 3}
    rows, columns = np.indices(images.depth.shape[1:])
    for row in range(2):
        fx, fy, cx, cy = images.intrinsics[row]
        depth = images.depth[row] * DEPTH_UNIT
        local = np.stack([(columns - cx) / fx * depth, (rows - cy) / fy * depth, depth], axis=-1)
        world = local @ images.poses[row, :3, :3].T + images.poses[row, :3, 3]
        table = (images.owners[row] == 0) & (depth > 0)
        np.testing.assert_allclose(world[table][:, 2], 0, atol=3e-4)
        for owner, middle in ((1, (0.0, 0.0)), (2, (0.25, 0.0))):
            places = world[images.owners[row] == owner]
            assert np.abs(np.median(places[:, :2], axis=0) - middle).max() < 0.1
            assert (places[:, 2] > -3e-4).all()


def test_a_second_call_makes_nothing_anew(scenes, tmp_path):
    task(scenes, tmp_path / "images").run()
    depth = StoredImages.open(tmp_path / "images/train", writable=True).depth
    depth[0] = 7
    depth.flush()
    task(scenes, tmp_path / "images").run()
    assert (StoredImages.open(tmp_path / "images/train").depth[0] == 7).all()
    counts = json.loads((tmp_path / "images/images.json").read_text())
    assert counts["train"] == counts["val"] == 2.0


def test_an_interrupted_call_goes_on(scenes, tmp_path):
    task(scenes, tmp_path / "whole").run()
    task(scenes, tmp_path / "images").run()
    images = StoredImages.open(tmp_path / "images/train", writable=True)
    images.owners[:] = 99
    images.facts["images"] = 0
    images.save()
    task(scenes, tmp_path / "images").run()
    for name in ("owners", "depth", "colour", "poses"):
        whole, again = (
            getattr(StoredImages.open(tmp_path / folder / "train"), name)
            for folder in ("whole", "images")
        )
        np.testing.assert_array_equal(whole, again)


def test_a_file_without_validation_scenes_is_told(tmp_path):
    path = save_scenes(tmp_path / "things.npz", [scene(0, "train")])
    with pytest.raises(InputError, match="no scenes of part val"):
        task(path, tmp_path / "images").run()


def test_bad_settings_are_told(scenes, tmp_path):
    with pytest.raises(InputError, match=r"give input=FILE\.npz"):
        task(None, tmp_path)
    cameras = HandheldCameras(sizes=[(32, 24), (64, 48)])
    with pytest.raises(ConfigError, match="expected one size"):
        RenderThings(scenes, cameras, ThingRenderer(), 1, 0, tmp_path)
    with pytest.raises(ConfigError, match="views"):
        task(scenes, tmp_path, views=0)
