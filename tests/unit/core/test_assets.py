import pytest

from scenefw.core import assets
from scenefw.core.errors import CheckpointError
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
