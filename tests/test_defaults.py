"""Constructors repeat no default that differs from what the options write."""

import inspect
import sys
from collections import defaultdict

import pytest
from hydra.utils import get_object
from omegaconf import OmegaConf
from tests.composed import every, is_global

from scenefw import config, plugins, registry

SCALARS = (bool, int, float, str)


def nodes(node):
    """All parts with a `_target_`, as plain containers."""
    if isinstance(node, dict):
        if isinstance(node.get("_target_"), str):
            yield node
        for value in node.values():
            yield from nodes(value)
    elif isinstance(node, list):
        for value in node:
            yield from nodes(value)


def written(parts):
    """Values that settings write, by class and argument; no references to other settings."""
    values = defaultdict(list)
    for part in parts:
        for node in nodes(part):
            for name, value in node.items():
                if not name.startswith("_") and not is_reference(value):
                    values[node["_target_"], name].append(plain(value))
    return values


def is_reference(value):
    return isinstance(value, str) and "${" in value


def plain(value):
    return tuple(value) if isinstance(value, list) else value


def all_settings():
    """The root, and every option of the core and of plugins."""
    yield OmegaConf.to_container(OmegaConf.load(config.conf_dir() / "config.yaml"))
    yield every()
    for options in registry.catalogue().values():
        yield from (registry.settings(path) for path in options.values() if is_global(path))


def disagreements(values):
    """`CLASS.ARGUMENT = DEFAULT` of defaults that are none of the values written."""
    for (target, name), options in sorted(values.items()):
        parameter = inspect.signature(get_object(target)).parameters.get(name)
        default = inspect.Parameter.empty if parameter is None else parameter.default
        is_number = isinstance(default, SCALARS) or (isinstance(default, tuple) and default)
        if is_number and not any(same(default, value) for value in options):
            yield f"{target}.{name} = {default!r}, where settings say {options}"


def same(default, value):
    """Equal, and no bool for a number."""
    return default == value and isinstance(default, bool) == isinstance(value, bool)


def test_a_default_is_a_value_that_settings_write():
    """Where they write one value, it is the default; None and () stand for without."""
    plugins.activate()
    assert list(disagreements(written(all_settings()))) == []


class Thing:
    """With defaults of each kind."""

    def __init__(self, size=1, name="a", sizes=(1, 2), *, on=False, other=None, extra=()):
        pass


@pytest.mark.parametrize(
    ("settings", "differing"),
    [
        ([{"size": 1, "name": "a", "sizes": [1, 2], "on": False}], []),
        ([{"size": 2}], ["size"]),
        ([{"size": 2}, {"size": 1}], []),
        ([{"size": 2}, {"size": "${seed}"}], ["size"]),
        ([{"size": "${seed}", "name": "${a}_${b}"}], []),
        ([{"size": True, "on": 0}], ["on", "size"]),
        ([{"sizes": [1], "other": 3, "extra": [4], "name": None}], ["name", "sizes"]),
    ],
)
def test_a_default_that_differs_is_named(monkeypatch, settings, differing):
    monkeypatch.setitem(sys.modules, "a_thing", sys.modules[__name__])
    parts = [{"part": [{"_target_": "a_thing.Thing", **part}]} for part in settings]
    told = list(disagreements(written(parts)))
    assert [line.split(" ")[0].rpartition(".")[2] for line in told] == differing
