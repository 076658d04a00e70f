"""Scenes of things in shards, and the picture of the library."""

import json

import numpy as np
import pytest
from PIL import Image

from scenefw import registry
from scenefw.core.errors import ConfigError
from scenefw_sweeps.local import Local
from scenefw_things.draw import DrawThings
from scenefw_things.generate import GenerateThings
from scenefw_things.scenes.generator import ThingScenes
from scenefw_things.scenes.physics import FastPhysics
from scenefw_things.scenes.scene import load_scenes
from scenefw_things.scenes.surroundings import Surroundings
from scenefw_things.shapes.source import Things
from scenefw_things.sheet import TILE


def task(folder, attempts=3, **settings):
    shapes = registry.build("shape", "things")
    source = ThingScenes(shapes, FastPhysics(), Surroundings(), maximum=3)
    return GenerateThings(
        source, Local(1), attempts, 0, 2, str(folder / "shards"), str(folder), **settings
    )


def test_shards_are_merged_and_made_once(tmp_path, capsys):
    pytest.importorskip("pybullet")
    counts = task(tmp_path).run()
    scenes = load_scenes(tmp_path / "things.npz")
    assert len(scenes) == counts["scenes"] > 0
    assert [scene.index for scene in scenes] == sorted({scene.index for scene in scenes})
    manifest = json.loads((tmp_path / "things.json").read_text())
    assert manifest["recipe"]["maximum"] == 3
    assert set(manifest["versions"]) >= {"numpy", "pybullet"}
    assert "2 of 2 shards" in capsys.readouterr().out
    task(tmp_path).run()
    assert "shards" not in capsys.readouterr().out.replace(str(tmp_path), "")
    again = load_scenes(tmp_path / "things.npz")
    assert [scene.items[0].thing for scene in again] == [scene.items[0].thing for scene in scenes]


def test_too_few_attempts_are_told(tmp_path):
    with pytest.raises(ConfigError, match="attempts = 0: expected"):
        task(tmp_path, attempts=0)


def test_the_picture_has_a_row_for_each_family(tmp_path, capsys):
    shapes = Things({"train": ["can", "book", "mug"]})
    counts = DrawThings(shapes, "train", 2, tmp_path).run()
    image = np.asarray(Image.open(tmp_path / "things.png"))
    assert counts == {"families": 3.0}
    assert image.shape == (2 * TILE, 4 * TILE, 3)
    tiles = image[:, : 2 * TILE].reshape(2, TILE, 2, TILE, 3).std(axis=(1, 3)).max(axis=-1)
    assert (tiles > 5).all()
    assert str(tmp_path / "things.png") in capsys.readouterr().out
