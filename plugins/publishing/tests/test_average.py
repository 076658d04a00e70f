"""Weights between those of two trainings."""

import json

import pytest
import torch

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import load_checkpoint, save_checkpoint
from scenefw.learning.provenance import digest, read_provenance
from scenefw_publishing.average import Average
from scenefw_single_view_benchmarks.baselines.fully_convolutional import FullyConvolutional


def saved(path, seed, widths=(2, 3), **metadata):
    torch.manual_seed(seed)
    network = FullyConvolutional(8, {"tsdf": 1, "votes": 3}, widths=widths).eval()
    for value in network.buffers():
        if value.is_floating_point():
            value.copy_(torch.rand_like(value))
    save_checkpoint(path, network, network.recipe, GridSpec(8), metadata)
    return network.state_dict()


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_each_number_lies_between_those_of_both(tmp_path, share, capsys):
    later = saved(tmp_path / "later.safetensors", 1, commit="later", steps=3)
    earlier = saved(tmp_path / "earlier.safetensors", 2, commit="earlier")
    average = Average(
        tmp_path / "later.safetensors", tmp_path / "earlier.safetensors", tmp_path / "out",
        share=share, half=False,
    )  # fmt: skip
    figures = average.run()
    target = tmp_path / "out" / "later.safetensors"
    assert capsys.readouterr().out.splitlines()[-1] == str(target)
    found = load_checkpoint(target)
    for name, value in found.model.state_dict().items():
        if value.is_floating_point():
            wanted = share * later[name] + (1 - share) * earlier[name]
            torch.testing.assert_close(value, wanted, atol=1e-6, rtol=0)
        else:
            assert torch.equal(value, later[name])
    assert figures["share"] == share
    assert figures["apart"] > 0
    known = read_provenance(target)
    assert known.metadata["commit"] == "later"
    assert known.metadata["averaged_with"] == {
        "file": "earlier.safetensors",
        "sha256": digest(tmp_path / "earlier.safetensors"),
        "share": 1 - share,
    }
    assert json.dumps(dict(known.metadata))  # plain facts alone


def test_the_mean_of_weights_with_themselves_are_these(tmp_path):
    own = saved(tmp_path / "own.safetensors", 1)
    file = tmp_path / "own.safetensors"
    assert Average(file, file, tmp_path / "out", half=False).run()["apart"] == 0
    found = load_checkpoint(tmp_path / "out" / "own.safetensors").model.state_dict()
    assert all(torch.equal(found[name], value) for name, value in own.items())


def test_two_networks_have_no_mean(tmp_path):
    saved(tmp_path / "one.safetensors", 1)
    saved(tmp_path / "two.safetensors", 1, widths=(2, 4))
    files = tmp_path / "one.safetensors", tmp_path / "two.safetensors"
    with pytest.raises(CheckpointError, match="two networks"):
        Average(*files, tmp_path / "out").run()
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("wrong", [{"before": None}, {"checkpoint": None}])
def test_both_weights_are_needed(tmp_path, wrong):
    given = {"checkpoint": "simstack", "before": "simstack", "output": tmp_path}
    with pytest.raises(ConfigError, match=r"run\.before=FILE"):
        Average(**{**given, **wrong})


@pytest.mark.parametrize("share", [0.0, 1.0, -1.0, float("nan")])
def test_a_share_lies_between_none_and_all(tmp_path, share):
    with pytest.raises(ConfigError, match="share = "):
        Average("simstack", "simstack", tmp_path, share=share)
