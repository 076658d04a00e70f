"""Values of a wrong kind are found before the work, and the line names what the user has set."""

import functools
import re
import sys
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf
from tests.composed import base

from scenefw import config, plugins, registry
from scenefw.argument_types import check_types
from scenefw.core.errors import ConfigError
from scenefw.execution.parts import require_types

# As components are written: annotations are strings, others are objects
COMPONENT = """
{future}
from collections.abc import Sequence
from pathlib import Path

class Component:
    def __init__(
        self, rate: float = 0.5, count: int = 3, flag: bool = False, limit: int | None = None,
        size: tuple[int, int] = (4, 3), levels: Sequence[float] | None = None, name: str = "",
        words: Sequence[str] = (), file: str | Path | None = None,
        both: float | Sequence[float] = 1.0, part: object = None, **more: float,
    ): ...
"""


@pytest.fixture(scope="module", autouse=True)
def _plugins():
    plugins.activate()


@pytest.fixture(scope="module", params=["from __future__ import annotations", ""])
def _component(request):
    module = ModuleType("made_component")
    exec(COMPONENT.format(future=request.param), module.__dict__)
    sys.modules["made_component"] = module
    yield
    del sys.modules["made_component"]


def settings(**values):
    node = {"_target_": "made_component.Component", **values}
    return OmegaConf.create({"run": {"_target_": "made_component.Component", "part": node}})


@pytest.mark.usefixtures("_component")
@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("rate", "fast", "run.part.rate is fast; expected a number, such as 0.5"),
        ("rate", True, "run.part.rate is true; expected a number"),
        ("rate", None, "run.part.rate is null; expected a number"),
        ("rate", [0.1], r"run.part.rate is \[0.1\]; expected a number"),
        ("count", 2.5, "run.part.count is 2.5; expected a whole number, such as 3"),
        ("flag", 1, "run.part.flag is 1; expected true or false"),
        ("limit", "few", "run.part.limit is few; expected a whole number or null"),
        ("size", 64, r"run.part.size is 64; expected a list such as \[4, 3\]"),
        ("size", [64, "a"], r"run.part.size is \[64, a\]; expected a list such as \[4, 3\]"),
        ("size", [64, None], "run.part.size"),
        ("levels", [0.1, "b"], "run.part.levels .* expected a list of numbers"),
        ("words", 3, "run.part.words is 3; expected a list of words"),
        (
            "file",
            7,
            "run.part.file is 7; expected a path or .* quotes: \"run.part.file='7'\"",
        ),
        ("file", 0.5, "run.part.file is 0.5; expected a path"),
        ("file", True, "run.part.file is true; expected a path or null; a name"),
        ("file", ["a"], "run.part.file .* expected a path"),
        ("name", ["a"], "run.part.name .* expected text"),
    ],
)
def test_a_value_of_another_kind_is_one_line(name, value, expected):
    with pytest.raises(ConfigError, match=f"^{expected}"):
        check_types(settings(**{name: value}), "run")


@pytest.mark.usefixtures("_component")
@given(
    st.fixed_dictionaries(
        {},
        optional={
            "rate": st.integers() | st.floats(),
            "count": st.integers(),
            "flag": st.booleans(),
            "limit": st.none() | st.integers(),
            "size": st.lists(st.integers(), max_size=3),
            "levels": st.none() | st.lists(st.floats() | st.integers(), max_size=3),
            "name": st.integers() | st.text("abc/._", max_size=9),
            "file": st.none() | st.text("abc/._", max_size=9),
            "both": st.sampled_from(["left to the component", 3, [1.0]]),
            "part": st.sampled_from(["left to the component", None, 3]),
            "other": st.sampled_from(["left to the component", None, 3]),
        },
    )
)
def test_values_of_the_right_kind_pass(values):
    check_types(settings(**values), "run")


@pytest.mark.usefixtures("_component")
def test_the_line_names_the_setting_that_a_value_comes_from():
    whole = settings(rate="${learning.rate}", count="${oc.select:sizes.count,7}")
    whole.learning = {"rate": "${size.speed}"}
    whole.size = {"speed": 0.1}
    check_types(whole, "run")
    whole.sizes = {"count": "many"}
    with pytest.raises(ConfigError, match=r"^sizes\.count is many; expected a whole number"):
        check_types(whole, "run")
    whole.size.speed = "slow"
    with pytest.raises(ConfigError, match=r"^size\.speed is slow"):
        check_types(whole, "run")


@pytest.mark.usefixtures("_component")
def test_parts_are_checked_wherever_they_lie():
    part = {"_target_": "made_component.Component", "count": 1}
    whole = OmegaConf.create({"run": {"all": ["${tool}"], "near": {"a": "${..own}"}, "own": part}})
    whole.tool = {"first": "${b}", "second": "${run.all}"}  # a circle ends
    whole.b = dict(part)
    check_types(whole, "run")
    whole.b.count = "x"
    with pytest.raises(ConfigError, match=r"^b\.count is x"):
        check_types(whole, "run")
    whole.b.count, whole.run.own.count = 1, "y"
    with pytest.raises(ConfigError, match=r"^run\.(own|near\.a)\.count is y"):
        check_types(whole, "run")


def test_what_cannot_be_imported_is_left_to_the_building():
    check_types(OmegaConf.create({"run": {"_target_": "no.such.Thing", "rate": "x"}}), "run")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("learning.learning_rate", "fast"),
        ("size.batch", "big"),
        ("size.minutes", "long"),
        ("optimizer.rate", "fast"),
        ("model.latent_size", 1.5),
        ("loss.tsdf.weight", "none"),
    ],
)
def test_settings_of_a_training(key, value):
    whole = base("run=train").copy()
    OmegaConf.update(whole, key, value)
    with pytest.raises(ConfigError, match=rf"^{re.escape(key)} is {value}"):
        check_types(whole, "run")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("run=train loss=[cross_entropy]", r"^loss\.cross_entropy is a CrossEntropy, which takes"),
        ("run=train model=fusenet", r"^model is a FuseNet, which .* expected a ShapeInstanceModel"),
        ("run=generate scene=tabletop", r"^scene is a DeskGenerator, which gives TabletopScene"),
        (
            "run=evaluate renderer=mesh_raycaster",
            r"^renderer is a MeshRaycaster, .* a SurfaceRenderer",
        ),
        ("run=train dataset=tabletop", r"^dataset is a TabletopScenes, .* expected a TrainingData"),
        (
            "run=predict run.pipeline=3",
            r"^run\.pipeline is 3; expected a part \(ReconstructionPipeline\)$",
        ),
        (
            "run=predict completion.checkpoint=my.safetensors",
            r"^completion\.checkpoint is my\.safetensors; expected a part \(Trained\)",
        ),
        ("run=predict run.settling=at_rest", r"^run\.settling is at_rest; .* \(Settling\)"),
        ("run=evaluate evaluation=labelling_curves", r"^dataset is a StackData, .* a FrameSource"),
    ],
)
def test_parts_that_do_not_fit_are_named(words, expected):
    with pytest.raises(ConfigError, match=expected):
        check_types(config.compose(words.split()), "run")


def test_each_of_several_parts_is_looked_at():
    whole = config.compose(["run=train", "noise=[pose,gaussian]"])
    check_types(whole, "run")
    whole.noise.gaussian = {"_target_": "scenefw.mapping.odometry.RGBDOdometry"}
    with pytest.raises(ConfigError, match=r"^noise\.gaussian is a RGBDOdometry"):
        check_types(whole, "run")


@pytest.mark.parametrize(
    ("words", "place"),
    [
        ("run=predict run.pipeline=3", "reconstructor"),
        ("run=predict observer.workspace=2", "observer.workspace"),
        ("run=predict reconstructor.completion=x", "completion"),
        ("run=doctor run.examiner=3", "run.examiner"),
        ("run=decompose run.pipeline.grouping=3", "run.pipeline.grouping"),
    ],
)
def test_the_settings_of_a_part_are_named_where_they_can_be_typed(words, place):
    overrides = words.split()
    with pytest.raises(ConfigError, match=rf"give its settings as {re.escape(place)}\.NAME="):
        require_types(config.compose(overrides), "run", overrides, options())


@functools.cache
def options():
    return {group: sorted(names) for group, names in registry.catalogue().items()}
