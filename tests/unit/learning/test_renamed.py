"""Trainings and weights go on under names that code has been given since."""

import inspect

import pytest
import torch
from hydra.utils import get_object
from tests.unit.learning import plain
from torch import nn

from scenefw.core.errors import CheckpointError
from scenefw.learning import renamed
from scenefw.learning.checkpoint import load_checkpoint, save_checkpoint
from scenefw.learning.optimizers import Muon
from scenefw.models.fusenet import FuseNet


class Renamed(plain.Network):
    """The same network, its layers declared in another order under other names."""

    def __init__(self, batched=False):
        super().__init__()
        last, first = self.last, self.first
        del self.first, self.last
        self.recipe = {"_target_": "scenefw.new", "batched": batched}
        self.head, self.stem = last, nn.ModuleDict({"linear": first})

    def forward(self, inputs):
        return self.head(self.between(self.stem["linear"](inputs)))


@pytest.fixture
def names(monkeypatch):
    monkeypatch.setitem(renamed.CLASSES, "scenefw.none", "scenefw.new")
    monkeypatch.setitem(renamed.ARGUMENTS, "scenefw.new.normalised", "batched")
    monkeypatch.setitem(renamed.MODULES, "first", "stem.linear")
    monkeypatch.setitem(renamed.MODULES, "last", "head")
    monkeypatch.setitem(renamed.FACTS, "kind", "sort")
    monkeypatch.setitem(renamed.LOSSES, "error", "squared")


@pytest.mark.parametrize("optimizer", [None, Muon()])
def test_a_training_goes_on_after_its_code_was_renamed(tmp_path, monkeypatch, names, optimizer):
    options = {"learning": {"optimizer": optimizer}}
    for name, steps in (("whole", 9), ("parts", 6)):
        monkeypatch.setattr(plain.Learning, "facts", lambda _: {"kind": 1, "losses": {"error": 1}})
        plain.task(tmp_path / name, steps=steps, **options).run()
    monkeypatch.setattr(plain, "Network", Renamed)
    monkeypatch.setattr(plain.Learning, "facts", lambda _: {"sort": 1, "losses": {"squared": 1}})
    plain.task(tmp_path / "parts", steps=9, **options).run()
    whole, parts = plain.state(tmp_path / "whole"), plain.state(tmp_path / "parts")
    assert set(parts["state_dict"]) != set(whole["state_dict"])
    for name, value in whole["state_dict"].items():
        own = name.removeprefix("model.")
        assert torch.equal(parts["state_dict"][f"model.{renamed.weight(own)}"], value)
        average = parts["scenefw"]["average"]["values"][renamed.weight(own)]
        assert torch.equal(average, whole["scenefw"]["average"]["values"][own])


def test_without_the_names_it_is_another_network(tmp_path, monkeypatch):
    plain.task(tmp_path, steps=6).run()
    monkeypatch.setattr(plain, "Network", Renamed)
    with pytest.raises(CheckpointError, match="had a different network"):
        plain.task(tmp_path, steps=9).run()


class Before(nn.Module):
    """A network as it was called before."""

    def __init__(self, network):
        super().__init__()
        self.net = network.body


def test_weights_are_read_under_new_names(tmp_path, monkeypatch):
    network = FuseNet(classes=3, widths=(8, 8), modules=(1, 1))
    target = network.recipe["_target_"]
    rest = {name: value for name, value in network.recipe.items() if name != "classes"}
    recipe = {**rest, "_target_": "scenefw.models.before.Before", "labels": 3}
    path = tmp_path / "weights.safetensors"
    save_checkpoint(path, Before(network), recipe, None, task="segmentation")
    with pytest.raises(CheckpointError, match=r"scenefw\.models\.before"):
        load_checkpoint(path, task="segmentation")
    monkeypatch.setitem(renamed.CLASSES, "scenefw.models.before.Before", target)
    monkeypatch.setitem(renamed.ARGUMENTS, f"{target}.labels", "classes")
    monkeypatch.setitem(renamed.MODULES, "net", "body")
    loaded = load_checkpoint(path, task="segmentation")
    assert loaded.recipe == network.recipe
    for name, value in network.state_dict().items():
        assert torch.equal(loaded.model.state_dict()[name], value)


def test_weights_without_an_argument_are_read_as_they_were_meant(tmp_path, monkeypatch):
    network = FuseNet(classes=3, widths=(8, 8), modules=(1, 1), block=2)
    target = network.recipe["_target_"]
    recipe = {name: value for name, value in network.recipe.items() if name != "block"}
    path = tmp_path / "weights.safetensors"
    save_checkpoint(path, network, recipe, None, task="segmentation")
    with pytest.raises(CheckpointError, match="don't fit"):
        load_checkpoint(path, task="segmentation")
    monkeypatch.setitem(renamed.ADDED, f"{target}.block", 2)
    assert load_checkpoint(path, task="segmentation").recipe == network.recipe


@pytest.mark.parametrize("argument", renamed.ADDED)
def test_added_arguments_are_those_of_networks(argument):
    target, _, name = argument.rpartition(".")
    assert name in inspect.signature(get_object(target)).parameters
