"""Dotted names, and what is wrong with those that can't be imported."""

import logging.handlers

import pytest

from scenefw.core.dotted_names import resolve


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("logging", logging),
        ("logging.handlers", logging.handlers),
        ("logging.Handler", logging.Handler),
        ("logging.handlers.QueueHandler.emit", logging.handlers.QueueHandler.emit),
    ],
)
def test_modules_and_what_is_in_them(name, expected):
    assert resolve(name) is expected


@pytest.fixture
def package(tmp_path, monkeypatch):
    folder = tmp_path / "package_of_a_test"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "wanting.py").write_text("import no_such_library_of_a_test\n")
    (folder / "odd.py").write_text("from json import no_such_name\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    return folder.name


def test_a_library_that_a_module_lacks_is_named(package):
    with pytest.raises(ModuleNotFoundError, match="no_such_library_of_a_test"):
        resolve(f"{package}.wanting.Thing")


def test_a_name_that_a_library_lacks_is_named(package):
    with pytest.raises(ImportError, match="no_such_name"):
        resolve(f"{package}.odd.Thing")


def test_a_name_that_the_module_itself_lacks_is_an_attribute(package):
    with pytest.raises(AttributeError, match="absent"):
        resolve(f"{package}.absent.Thing")
    with pytest.raises(ModuleNotFoundError, match="no_such_package"):
        resolve("no_such_package.module.Thing")
