import pytest
import torch
from tests.unit.learning.tiny import learning, network

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import save_checkpoint
from scenefw.learning.initial import start_from


def moved(model):
    with torch.no_grad():
        for value in model.parameters():
            value.add_(0.5)
    return model


def test_a_network_takes_on_the_weights_of_a_file(tmp_path):
    stored = moved(network())
    save_checkpoint(tmp_path / "a.safetensors", stored, stored.recipe, GridSpec(8))
    model = network()
    start_from(model, tmp_path / "a.safetensors")
    found = model.state_dict()
    assert all(torch.equal(value, found[name]) for name, value in stored.state_dict().items())


def test_what_only_training_needs_starts_anew(tmp_path):
    stored, fresh = moved(network()), network()
    path = tmp_path / "a.safetensors"
    save_checkpoint(path, stored, stored.recipe, GridSpec(8), omit=("encoder",))
    found = learning(initial=path).model.state_dict()
    for name, value in fresh.state_dict().items():
        expected = value if name.startswith("encoder.") else stored.state_dict()[name]
        assert torch.equal(found[name], expected), name


def test_weights_of_another_network_are_refused(tmp_path):
    other = network(16)
    save_checkpoint(tmp_path / "a.safetensors", other, other.recipe, GridSpec(16))
    with pytest.raises(CheckpointError, match="a different network"):
        start_from(network(8), tmp_path / "a.safetensors")


def test_a_network_for_another_task_is_refused(tmp_path):
    stored = network()
    save_checkpoint(tmp_path / "a.safetensors", stored, stored.recipe, GridSpec(8))
    with pytest.raises(CheckpointError, match="trained for"):
        start_from(network(), tmp_path / "a.safetensors", "segmentation")


def test_named_modules_start_anew(tmp_path):
    stored, fresh = moved(network()), network()
    save_checkpoint(tmp_path / "a.safetensors", stored, stored.recipe, GridSpec(8))
    found = learning(
        initial=tmp_path / "a.safetensors", reinitialise=["decoder.linear"]
    ).model.state_dict()
    for name, value in fresh.state_dict().items():
        new = name.startswith("decoder.linear.")
        assert torch.equal(found[name], value if new else stored.state_dict()[name]), name


def test_an_unknown_module_is_refused_with_those_there_are(tmp_path):
    stored = network()
    save_checkpoint(tmp_path / "a.safetensors", stored, stored.recipe, GridSpec(8))
    with pytest.raises(ConfigError, match=r"decoder\.lin,.*decoder\.linear"):
        start_from(network(), tmp_path / "a.safetensors", reinitialise=["decoder.lin"])
