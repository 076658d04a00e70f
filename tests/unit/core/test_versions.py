from importlib import metadata

import pytest
import torch

from scenefw.core import versions


def test_versions_are_those_of_the_packages():
    assert versions.installed(["torch", "no-such-package"]) == {"torch": torch.__version__}


def test_a_checkout_that_is_not_installed_knows_its_own(monkeypatch):
    expected = metadata.version("scenefw")

    monkeypatch.setattr(metadata, "version", _raise)
    assert versions.installed(["scenefw", "torch"]) == {"scenefw": expected}


@pytest.mark.parametrize("file", ["nowhere.toml", "."])
def test_without_any_record_it_is_left_out(monkeypatch, tmp_path, file):
    monkeypatch.setattr(metadata, "version", _raise)
    monkeypatch.setattr(versions, "_PROJECT", tmp_path / file)
    assert versions.installed(["scenefw"]) == {}


def _raise(name):
    raise metadata.PackageNotFoundError(name)
