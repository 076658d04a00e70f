import builtins
import json

import numpy as np
import onnx
import pytest
import torch
from torch import nn

from scenefw.core.batches import ShapeInstancePrediction
from scenefw.core.errors import CheckpointError, InputError, MissingDependencyError
from scenefw.core.types import GridSpec
from scenefw.learning.checkpoint import Checkpoint
from scenefw.models.fusenet import FuseNet
from scenefw.models.set_placed_vae import PlacedSetVAE
from scenefw.models.set_vae import SetVAE
from scenefw.models.shape_instance_vae import ShapeInstanceVAE
from scenefw_onnx import files as onnx_files
from scenefw_onnx.files import compare, require_onnx, session, write_onnx
from scenefw_onnx.networks import NamedNetwork, named_network

WIDTHS = (2,) * 5


def vae():
    return ShapeInstanceVAE(
        8,
        latent_size=3,
        bottleneck=3,
        condition_widths=WIDTHS,
        encoder_widths=WIDTHS,
        decoder_widths=WIDTHS,
        stem_width=2,
        branch_width=2,
        code_width=2,
    )


NETWORKS = {
    "vae": (vae, "shape_instance"),
    "shapes_of_a_plugin": (lambda: Shapes(), "shape_instance"),
    "labels_of_a_plugin": (lambda: Labels(), "segmentation"),
    "labels": (lambda: FuseNet(3, (3, 4), (1, 1), block=2), "segmentation"),
    "drawn_sets_in_boxes": (lambda: PlacedSetVAE(8, 2, 4, 2, 4, (4,), (4,)), "object_sets"),
    "sets": (
        lambda: SetVAE(8, 2, 4, 2, (4, 3), (4, 3), WIDTHS, 3, existence=True, centres=True),
        "object_sets",
    ),
}


class Shapes(nn.Module):
    """A network of volumes as a plugin writes one: it knows no resolution, and has no code."""

    training_only, latent_size = (), 0

    def __init__(self):
        super().__init__()
        self.outputs, self.recipe = {"tsdf": 1, "votes": 3}, {}
        self.layer = nn.Conv3d(2, 4, 3, padding=1)

    def predict(self, condition, latent=None):
        tsdf, votes = self.layer(condition).split([1, 3], dim=1)
        return ShapeInstancePrediction({"tsdf": tsdf, "votes": votes})


class Labels(nn.Module):
    """A labelling network as a plugin writes one."""

    training_only, classes, stride, margin = (), 3, 1, 1

    def __init__(self):
        super().__init__()
        self.recipe = {}
        self.layer = nn.Conv2d(4, 3, 3, padding=1)

    def forward(self, colour, distance):
        return self.layer(torch.cat([colour, distance.nan_to_num()], dim=1))


def facts_of(file):
    """The metadata that `write_onnx` wrote, by name."""
    found = session(file, 1).get_modelmeta().custom_metadata_map
    return {
        key.removeprefix("scenefw."): json.loads(value)
        for key, value in found.items()
        if key.startswith("scenefw.")
    }


def network(kind):
    torch.manual_seed(0)
    make, task = NETWORKS[kind]
    made = make().train()
    for module in made.modules():  # statistics that are not 0 and 1
        if isinstance(module, nn.modules.batchnorm._BatchNorm):
            module.running_mean.normal_()
            module.running_var.uniform_(0.5, 2)
    metadata = {"classes": ["a", "b", "c"], "input": "views"}
    return named_network(Checkpoint(made.eval(), GridSpec(8), {}, metadata), task)


QUICK = ("shapes_of_a_plugin", "labels_of_a_plugin")


@pytest.mark.parametrize(
    "kind", [k if k in QUICK else pytest.param(k, marks=pytest.mark.exhaustive) for k in NETWORKS]
)
def test_onnxruntime_gives_what_torch_gives(kind, tmp_path):
    named = network(kind)
    difference = write_onnx(tmp_path / "a.onnx", named, {"sha256": "0f"}, 1e-4)
    assert 0 < difference < 1e-4
    run = session(tmp_path / "a.onnx")
    shapes = [one.shape for one in (*run.get_inputs(), *run.get_outputs())]
    wanted = [*named.inputs.values(), *named.outputs.values()]
    assert [tuple(shape) for shape in shapes] == wanted
    sizes = {"batch": 4, "height": 21, "width": 30}  # not among those of the comparison
    inputs = named.example(sizes, torch.Generator().manual_seed(5))
    found = run.run(None, dict(zip(named.inputs, map(np.asarray, inputs), strict=True)))
    with torch.no_grad():
        for one, other in zip(named.module(*inputs), found, strict=True):
            np.testing.assert_allclose(other, one.numpy(), atol=1e-4)
    facts = facts_of(tmp_path / "a.onnx")
    assert facts["sha256"] == "0f"
    if kind == "labels":
        assert facts["window"] == {"stride": 4, "margin": 12}
        assert facts["classes"] == ["a", "b", "c"]
    assert b"/src/" not in (tmp_path / "a.onnx").read_bytes()  # no path of this machine


class Scaled(nn.Module):
    def __init__(self, in_turn=False):
        super().__init__()
        self.factor = nn.Parameter(torch.tensor(3.0))
        self.in_turn = in_turn

    def forward(self, x):
        rows = [x[i] for i in range(x.shape[0])] if self.in_turn else x
        return ((torch.stack(rows) if self.in_turn else x) * self.factor,)


def example(sizes, generator):
    return (torch.rand(sizes["batch"], 2, generator=generator),)


def scaled(**words):
    sizes = ({"batch": 2}, {"batch": 5})
    shape = ("batch", 2)
    return NamedNetwork(Scaled(**words).eval(), {"x": shape}, {"y": shape}, example, sizes, {})


def test_what_differs_is_not_written(tmp_path, monkeypatch):
    named = scaled()
    write_onnx(tmp_path / "a.onnx", named, {}, 1e-4)
    content = (tmp_path / "a.onnx").read_bytes()
    with torch.no_grad():
        named.module.factor += 0.1
    with pytest.raises(InputError, match=r"y differs from torch's by 0\.0\d+, .*run\.tolerance"):
        compare(content, named, 1e-4)
    monkeypatch.setattr(onnx_files, "_exported", lambda *_: onnx.load_from_string(content))
    with pytest.raises(InputError, match="nothing was written"):
        write_onnx(tmp_path / "b.onnx", named, {}, 1e-4)
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


def test_a_network_that_fixes_the_batch_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"static shape of 2 for dimension .*\['x'\]") as caught:
        write_onnx(tmp_path / "a.onnx", scaled(in_turn=True), {}, 1e-4)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_networks_without_a_test_pass_of_one_call_are_refused():
    with pytest.raises(CheckpointError, match="networks for set_flow are not exported"):
        named_network(Checkpoint(nn.Identity(), None, {}, {}), "set_flow")


def test_a_missing_library_is_named(monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **words):
        if name == "onnxruntime":
            raise ModuleNotFoundError(name=name)
        return real(name, *rest, **words)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingDependencyError, match=r"need onnxruntime: pip install 'scenefw\["):
        require_onnx()
