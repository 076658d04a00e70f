import hashlib

import pytest
import torch
from plugins.onnx.tests.test_files import facts_of

from scenefw.core.errors import CheckpointError, ConfigError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import load_checkpoint, save_checkpoint
from scenefw_onnx.files import session
from scenefw_onnx.task import ExportONNX
from scenefw_single_view_benchmarks.baselines.fully_convolutional import FullyConvolutional


@pytest.mark.exhaustive
def test_a_file_of_weights_becomes_a_file_that_says_where_it_is_from(tmp_path, capsys):
    torch.manual_seed(0)
    network = FullyConvolutional(8, {"tsdf": 1, "votes": 3}, widths=(2, 3)).eval()
    weights, grid = tmp_path / "mine.safetensors", GridSpec(8)
    save_checkpoint(weights, network, network.recipe, grid, {"commit": "c0ffee"})
    figures = ExportONNX(weights, tmp_path / "out").run()
    printed = capsys.readouterr().out.splitlines()
    target = tmp_path / "out" / "mine.onnx"
    assert printed[-1] == str(target)
    assert "input  condition: batch x 2 x 8 x 8 x 8" in printed
    assert "output votes: batch x 3 x 8 x 8 x 8" in printed
    assert figures["megabytes"] == target.stat().st_size / 1e6
    facts = facts_of(target)
    assert facts["sha256"] == hashlib.sha256(weights.read_bytes()).hexdigest()
    assert GridSpec(**{**facts["grid"], "lower": tuple(facts["grid"]["lower"])}) == grid
    assert facts["training_commit"] == "c0ffee"
    assert facts["task"] == "shape_instance"
    view = torch.rand(1, 2, 8, 8, 8)
    (tsdf,) = session(target).run(["tsdf"], {"condition": view.numpy()})
    with torch.no_grad():
        wanted = load_checkpoint(weights).model.predict(view).tsdf
    torch.testing.assert_close(torch.from_numpy(tsdf), wanted, atol=1e-4, rtol=0)


def test_what_cannot_be_exported_ends_before_the_work(tmp_path):
    with pytest.raises(ConfigError, match=r"run\.tolerance = 0"):
        ExportONNX(None, tmp_path, tolerance=0)
    with pytest.raises(CheckpointError, match="no weights 'simstak'"):
        ExportONNX("simstak", tmp_path).run()
    assert not list(tmp_path.iterdir())
