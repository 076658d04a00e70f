from pathlib import Path

import numpy as np
import pytest

from scenefw.core import assets
from scenefw.core.errors import CheckpointError
from scenefw.data.files.readers import read_frame
from scenefw.learning.checkpoint import shipped_checkpoint, weights_file


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    """The assets of a plugin, known for one test."""
    monkeypatch.setattr(assets, "_folders", [])
    (tmp_path / "mine.safetensors").write_bytes(b"x")
    assets.search_also([tmp_path, tmp_path, tmp_path / "missing"])
    return tmp_path


def test_weights_of_a_plugin_are_found_by_name(plugin):
    assert weights_file("mine") == plugin / "mine.safetensors"
    assert assets.weights()["simstack"] == [shipped_checkpoint()]
    assert assets.folders()[1:] == (plugin, plugin / "missing")


def test_names_that_nobody_or_several_have(plugin):
    names = "label_maps, label_views, mine, part_affinity, set_extents, simstack"
    with pytest.raises(CheckpointError, match=f"'other'.* {names}"):
        weights_file("other")
    (plugin / "simstack.safetensors").write_bytes(b"x")
    with pytest.raises(CheckpointError, match=f"come with .*assets and {plugin}; give the file"):
        weights_file("simstack")


def test_the_example_has_a_name_that_a_file_may_take(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert assets.image_path("example") == assets.example_image()
    assert assets.image_path("./other.npz") == Path("other.npz")
    Path("example").mkdir()
    assert assets.image_path("example") == Path("example")


def test_the_example_is_a_depth_image_with_colour():
    frame = read_frame(assets.example_image())
    assert frame.depth.shape == (480, 640)
    assert frame.colour is not None
    assert 0.5 < np.median(frame.depth[frame.depth > 0]) < 1.5
