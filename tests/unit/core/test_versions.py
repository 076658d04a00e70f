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


def test_any_change_of_the_code_is_another_code(monkeypatch, tmp_path):
    (tmp_path / "plugins" / "one").mkdir(parents=True)
    (tmp_path / "package").mkdir()
    monkeypatch.setattr(versions, "_PACKAGE", tmp_path / "package")
    monkeypatch.setattr(versions, "_PROJECT", tmp_path / "pyproject.toml")
    (tmp_path / "pyproject.toml").touch()
    found = [versions.sources()]
    for name, text in (
        ("package/a.py", "x = 1"),
        ("package/a.py", "x = 2"),
        ("package/b.py", ""),
        ("plugins/one/c.py", "y = 1"),
    ):
        (tmp_path / name).write_text(text)
        found.append(versions.sources())
    assert len(set(found)) == 5
    (tmp_path / "package" / "notes.md").write_text("no code")
    assert versions.sources() == found[-1]
    (tmp_path / "package" / "b.py").rename(tmp_path / "package" / "d.py")
    assert versions.sources() not in found
