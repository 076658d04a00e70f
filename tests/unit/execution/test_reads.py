"""What a run does not read is an error, and the line says what it reads instead."""

import pytest
from omegaconf import OmegaConf

from scenefw.core.errors import ConfigError
from scenefw.execution.reads import require_read, settings_read

CONFIG = {
    "run": {
        "_target_": "x.Evaluate",
        "data": "${dataset}",
        "noise": "${oc.select:noise,{}}",
        "output": "${paths.output}/${size.name}",
        "after": {"_later_": "evaluation"},
        "list": ["${listed}"],
        "through": "${run.data.deep.name}",
    },
    "dataset": {
        "renderer": {"contrast": 0.1},
        "limit": "${size.limit}",
        "same": "${.limit}",
        "deep": "${deeper}",
    },
    "renderer": {"contrast": 0.2},
    "noise": {"gaussian": {"sigma": "${..level}"}, "level": "${size.level}"},
    "evaluation": {"views": "${size.views}", "up": "${..other}"},
    "other": 1,
    "listed": 2,
    "deeper": {"name": "${.near}", "near": "${size.near}"},
    "size": {"name": "a", "limit": 3, "views": 1, "level": 2, "minutes": 4, "near": 5},
    "paths": {"output": "out"},
}
OPTIONS = {"renderer": ["caster"], "noise": ["none"], "run": ["evaluate"], "scale": ["laptop"]}


def require(*overrides, choices=None):
    require_read(OmegaConf.create(CONFIG), overrides, OPTIONS, choices)


def test_references_of_every_kind_are_followed():
    read = settings_read(OmegaConf.create(CONFIG))
    leaves = {"dataset.renderer.contrast", "noise.gaussian.sigma", "noise.level", "paths.output"}
    assert leaves <= read
    assert {f"size.{name}" for name in ("name", "limit", "views", "level", "near")} <= read
    assert {"evaluation.views", "other", "listed"} <= read
    assert not {"size.minutes", "renderer", "renderer.contrast"} & read


@pytest.mark.parametrize(
    "override",
    ["size.limit=4", "noise=none", "~noise", "dataset.renderer={contrast:1}", "scale=laptop",
     "seed=3", "paths.training=x", "run=evaluate", "size.views=1,2"],
)  # fmt: skip
def test_what_is_read_may_be_given(override):
    require(override)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("size.minutes=2", r"size.minutes=2 changes nothing: this run \(Evaluate\) does not read"),
        ("renderer=caster", "read renderer; leave it out, or choose a run or an option that"),
        ("input=a.npz", "leave it out, or choose run=label or predict or an option"),
        ("renderer.contrast=1", "did you mean dataset.renderer.contrast=1?"),
    ],
)
def test_what_is_not_read_is_one_line(override, words):
    with pytest.raises(ConfigError, match=words):
        require("size.limit=1", override)


def test_a_group_that_stands_elsewhere_is_named():
    with pytest.raises(ConfigError, match=r"did you mean renderer@dataset.renderer=caster\?"):
        require(
            "renderer=caster",
            choices={"renderer@dataset.renderer": "x", "renderer@other_place": "y"},
        )
