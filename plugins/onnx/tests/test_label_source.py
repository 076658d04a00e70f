"""Labels of an exported network against torch."""

import sys
from dataclasses import replace

import numpy as np
import onnx
import pytest
import torch
from plugins.onnx.tests.test_files import Labels
from tests.unit.tasks.recordings import frames

from scenefw.core.errors import (
    CheckpointError,
    ConfigError,
    InputError,
    MissingDependencyError,
)
from scenefw.core.types import GridSpec
from scenefw.labelling.sources import NetworkLabels
from scenefw.learning.checkpoint import Checkpoint
from scenefw_onnx.files import write_onnx
from scenefw_onnx.label_source import OnnxLabels
from scenefw_onnx.networks import named_network

pytest.importorskip("onnxruntime", reason="pip install 'scenefw[onnx]'")
pytest.importorskip("onnxscript", reason="pip install 'scenefw[onnx]'")


@pytest.fixture(scope="module")
def checkpoint():
    """A small network that labels views."""
    torch.manual_seed(0)
    metadata = {"classes": ["a", "b", "c"], "input": "views"}
    return Checkpoint(Labels().eval(), GridSpec(8), {}, metadata)


@pytest.fixture(scope="module")
def views(checkpoint, tmp_path_factory):
    path = tmp_path_factory.mktemp("onnx") / "views.onnx"
    write_onnx(path, named_network(checkpoint, "segmentation"), {}, 1e-3)
    return path


def of_maps(folder, views):
    """The same, but that it labels height maps."""
    model = onnx.load(views)
    (kind,) = (fact for fact in model.metadata_props if fact.key == "scenefw.input")
    kind.value = '"maps"'
    onnx.save(model, folder / "maps.onnx")
    return folder / "maps.onnx"


@pytest.fixture(scope="module")
def frame():
    return next(frames(1))


@pytest.mark.parametrize("size", [(80, 60), (53, 37)])
def test_labels_are_those_of_torch(checkpoint, views, frame, size):
    width, height = size
    small = replace(
        frame,
        camera=replace(frame.camera, width=width, height=height),
        depth=frame.depth[:height, :width],
        colour=frame.colour[:height, :width],
        labels=None,
    )
    wanted = NetworkLabels(checkpoint).label(small)
    source = OnnxLabels(views, threads=1)
    found = source.label(small)
    assert found.shape == (len(source.classes), height, width)
    np.testing.assert_allclose(found.sum(axis=0), 1, atol=1e-5)
    np.testing.assert_allclose(found, wanted, atol=2e-3)
    assert wanted.std() > 0.01
    assert source.classes == NetworkLabels(checkpoint).classes


def test_what_cannot_be_used_is_one_line(views, frame, tmp_path, monkeypatch):
    with pytest.raises(InputError, match="no colour"):
        OnnxLabels(views).label(replace(frame, colour=None))
    with pytest.raises(ConfigError, match=r"label_source\.path"):
        OnnxLabels(None)
    with pytest.raises(ConfigError, match="threads is 0"):
        OnnxLabels(views, threads=0)
    with pytest.raises(CheckpointError, match="expected surface, cup"):
        OnnxLabels(views, classes=["surface", "cup"])
    with pytest.raises(CheckpointError, match="cannot read"):
        OnnxLabels(tmp_path / "missing.onnx")
    content = views.read_bytes()
    (tmp_path / "damaged.onnx").write_bytes(content[: len(content) // 2])
    with pytest.raises(CheckpointError, match="no ONNX file"):
        OnnxLabels(tmp_path / "damaged.onnx")
    with pytest.raises(CheckpointError, match="no network that labels views"):
        OnnxLabels(of_maps(tmp_path, views))
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(MissingDependencyError, match=r"scenefw\[onnx\]"):
        OnnxLabels(views)


def test_a_file_of_something_else_is_refused(tmp_path):
    path = tmp_path / "other.onnx"
    linear = torch.nn.Linear(2, 1).eval()
    program = torch.onnx.export(linear, (torch.zeros(1, 2),), dynamo=True, verbose=False)
    onnx.save(program.model_proto, path)
    with pytest.raises(CheckpointError, match="no network that labels views"):
        OnnxLabels(path)
