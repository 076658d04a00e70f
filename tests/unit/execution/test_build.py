"""Parts of a config become objects, each once."""

import sys
from types import ModuleType

import pytest
from omegaconf import OmegaConf

from scenefw.core.errors import ConfigError, InputError
from scenefw.execution.build import Builder

PARTS = """
from scenefw.core.errors import InputError
from scenefw.core.settings import COUNT

class Part:
    made = 0
    def __init__(self, size: int = 1, inner: object = None, **more):
        Part.made += 1
        self.size, self.inner, self.more = size, inner, more

class Strict:
    def __init__(self, needed, limit=3): self.needed, self.limit = needed, limit

class Ranged:
    def __init__(self, size=1):
        COUNT.require(size=size)

class Holder:
    def __init__(self, other=1): Ranged(size=0)

def fails(): raise KeyError("inside")
def complains(): raise InputError("that image is black; give another")
"""


@pytest.fixture(autouse=True)
def parts():
    module = ModuleType("made_parts")
    exec(PARTS, module.__dict__)
    sys.modules["made_parts"] = module
    yield module
    del sys.modules["made_parts"]


def build(key="run", **config):
    return Builder(OmegaConf.create(config)).build(key)


def part(**values):
    return {"_target_": "made_parts.Part", **values}


def test_what_is_referred_to_is_built_once_and_shared(parts):
    run = part(
        one="${shared}",
        other="${oc.select:shared,null}",
        deep={"list": ["${shared}", "${run.near}"], "near": "${..near}"},
        near=part(size=2),
    )
    made = build(run=run, shared=part(inner="${inner}"), inner=part(size="${size}"), size=7)
    assert parts.Part.made == 4
    more = made.more
    assert more["one"] is more["other"] is more["deep"]["list"][0]
    assert more["one"].inner.size == 7
    assert more["deep"]["list"][1] is more["near"] is more["deep"]["near"]


def test_equal_parts_that_stand_twice_are_two(parts):
    made = build(run=part(a=part(), b=part()))
    assert made.more["a"] is not made.more["b"]


def test_a_partial_part_waits_for_further_arguments(parts):
    make = build(run=part(size=4, _partial_=True))
    assert parts.Part.made == 0
    assert make(inner=3).inner == 3
    assert make().size == 4


def test_what_is_built_later_is_built_when_called_and_once(parts):
    made = build(run=part(inner={"_later_": "after"}), after=part(size=5))
    assert parts.Part.made == 1
    assert made.inner() is made.inner()
    assert parts.Part.made == 2
    assert made.inner().size == 5


def test_all_else_becomes_plain_python():
    made = build(run={"a": [1, {"b": None}], "c": "${oc.dict.keys:d}"}, d={"x": 1, "y": 2})
    assert made == {"a": [1, {"b": None}], "c": ["x", "y"]}
    assert type(made["a"][1]) is dict
    assert type(made["c"]) is list


@pytest.mark.parametrize(
    ("node", "words"),
    [
        ({"_target_": "made_parts.Nothing"}, "run: cannot import made_parts.Nothing"),
        ({"_target_": "made_nothing.Part"}, "run: cannot import made_nothing.Part"),
        ({"_target_": "made_parts.Strict"}, "run.needed is not set, and Strict needs it"),
        (
            {"_target_": "made_parts.Strict", "needed": 1, "limits": 2},
            "run.limits: Strict has no argument limits; did you mean limit",
        ),
        (
            {"_target_": "made_parts.Strict", "needed": "???"},
            "run.needed is not set; give run.need",
        ),
        ({"_target_": "made_parts.fails"}, "run cannot be built: fails says KeyError: 'inside'"),
    ],
)
def test_what_cannot_be_built_is_one_line(node, words):
    with pytest.raises(ConfigError) as caught:
        build(run=node)
    assert str(caught.value).startswith(words)


def test_a_class_that_has_moved_is_named_where_it_is():
    with pytest.raises(ConfigError, match=r"; Stereo is now scenefw\.noise\.stereo\.Stereo$"):
        build(run={"_target_": "scenefw.data.noise.Stereo"})


def test_a_components_own_complaint_comes_as_it_is():
    with pytest.raises(InputError, match="that image is black"):
        build(run={"_target_": "made_parts.complains"})


def test_a_wrong_value_is_named_by_the_key_to_type():
    ranged = {"_target_": "made_parts.Ranged"}
    with pytest.raises(ConfigError, match=r"^run\.inner\.size = 0: expected 1 or more$"):
        build(run=part(inner={**ranged, "size": 0}))
    with pytest.raises(ConfigError, match=r"^sizes\.batch = -1: expected 1 or more$"):
        build(run={**ranged, "size": "${sizes.batch}"}, sizes={"batch": -1})


def test_a_part_that_a_class_makes_by_itself_is_not_mistaken_for_its_own_argument():
    with pytest.raises(ConfigError, match=r"^size = 0: expected 1 or more$"):
        build(run={"_target_": "made_parts.Holder"})
