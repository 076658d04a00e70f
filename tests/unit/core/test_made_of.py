import functools
import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import torch

from scenefw.core.made_of import public, settings_of


@dataclass(frozen=True, slots=True)
class Slotted:
    size: int = 3
    names: tuple[str, ...] = ("a",)
    _kept: list[int] = field(default_factory=list)


class Plain:
    def __init__(self, scale, part=None):
        self.scale, self.part = scale, part
        self._kept = object()

    @functools.cached_property
    def table(self):
        return np.arange(4) * self.scale


def test_settings_are_plain_data_of_all_parts():
    found = settings_of(Plain(0.5, {"of": Slotted(), "path": Path("a/b"), "by": abs}))
    target = f"{__name__}."
    assert json.loads(json.dumps(found)) == {
        "_target_": f"{target}Plain",
        "part": {
            "of": {"_target_": f"{target}Slotted", "names": ["a"], "size": 3},
            "path": "a/b",
            "by": "builtins.abs",
        },
        "scale": 0.5,
    }


@pytest.mark.parametrize("array", [np.float32(0.5), np.array([[1, 2]]), torch.tensor([1.5, 2])])
def test_arrays_become_numbers(array):
    assert settings_of({"x": array}) == {"x": array.tolist()}


def test_what_is_remembered_does_not_count():
    """A name of results that changed while a component works would never be found again."""
    one = Plain(2)
    before = settings_of(one)
    one.table, one._kept  # noqa: B018
    assert settings_of(one) == before == settings_of(Plain(2))
    assert list(public(one)) == ["scale", "part"]


def test_every_setting_counts():
    assert settings_of(Plain(2)) != settings_of(Plain(3))
    assert settings_of(Plain(2, Slotted(3))) != settings_of(Plain(2, Slotted(4)))
