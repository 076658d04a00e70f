import hashlib

import pytest
from tests.unit.learning import tiny

from scenefw.core.errors import CheckpointError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import save_checkpoint, shipped_checkpoint
from scenefw.learning.provenance import origin, read_provenance


def test_a_file_says_what_it_is_without_being_rebuilt(tmp_path):
    model, path = tiny.network(), tmp_path / "w.safetensors"
    older = {"steps": 1, "started_from": {"steps": 4}}
    save_checkpoint(path, model, model.recipe, GridSpec(8), {"steps": 2, "started_from": older})
    found = read_provenance(path)
    assert found.recipe == model.recipe
    assert found.grid == GridSpec(8)
    assert found.numbers == sum(value.numel() for value in model.state_dict().values())
    assert found.digest == hashlib.sha256(path.read_bytes()).hexdigest()
    assert [training["steps"] for training in found.trainings] == [2, 1, 4]
    assert origin(path)["file"] == "w.safetensors"
    assert origin(path)["started_from"] == older


@pytest.mark.parametrize("name", ["simstack", "label_views", "label_maps"])
def test_shipped_weights_say_how_long_they_were_trained(name):
    (training, *_) = read_provenance(shipped_checkpoint(name)).trainings
    assert training["steps"] > 0
    assert training["samples"] >= training["steps"]


def test_a_file_from_elsewhere(tmp_path):
    (tmp_path / "w.safetensors").write_bytes(b"nothing of the kind")
    with pytest.raises(CheckpointError, match="not a safetensors file"):
        read_provenance(tmp_path / "w.safetensors")
    with pytest.raises(CheckpointError, match="no checkpoint at"):
        read_provenance(tmp_path / "other.safetensors")
