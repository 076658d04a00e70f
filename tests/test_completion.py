"""What a shell completes, against what Hydra composes, and in the shells themselves."""

import os
import shutil
import subprocess
import sys

import pytest
from omegaconf import OmegaConf

from scenefw import completion, config, plugins, registry


def shell(name, text):
    if shutil.which(name) is None:
        pytest.skip(f"{name} is not installed")
    words = [name, "-f", "-c", text] if name == "zsh" else [name, "--norc", "-c", text]
    return subprocess.run(words, capture_output=True, text=True, check=True).stdout.split()


def test_options_of_a_group_also_in_lists_and_sweeps():
    names = {f"loss=[tsdf,{name}" for name in registry.names("loss") if name.startswith("vo")}
    assert "loss=[tsdf,votes" in names
    assert set(completion.answers("scenefw loss=[tsdf,vo")) == names
    assert "noise=none,kinect" in completion.answers("scenefw -m noise=none,ki")
    assert completion.answers("scenefw experiment=simstack_s") == ["experiment=simstack_shipped"]
    assert "experiment=thesis/simstack" in completion.answers("scenefw experiment=thesis/s")
    answers = completion.answers("scenefw experiment=")
    assert not any("=_" in answer or "/_" in answer for answer in answers)
    assert completion.answers("scenefw --list rende") == ["renderer"]
    assert "checkpoint=simstack" in completion.answers("scenefw checkpoint=")
    assert completion.answers("scenefw nonsense.") == []


@pytest.mark.parametrize(
    ("typed", "path"),
    [
        (["run=predict"], "run"),
        (["run=predict"], "reconstructor"),  # chosen by the option of `run`
        (["experiment=thesis/simstack"], "learning"),  # by a file of a file that it names
        (["loss=[tsdf,votes]"], "loss"),
    ],
)
def test_settings_are_those_that_hydra_composes(typed, path):
    plugins.activate()
    node = OmegaConf.to_container(OmegaConf.select(config.compose(typed), path))
    expected = {f"{path}.{name}" for name in node if not name.startswith("_")}
    answers = completion.answers(f"python -m scenefw {' '.join(typed)} {path}.")
    assert {answer.rstrip("=.") for answer in answers} == expected
    groups = {answer for answer in answers if answer.endswith(".")}
    nested = {f"{path}.{name}." for name, value in node.items() if isinstance(value, dict)}
    assert groups <= nested


def test_switches_and_beginnings():
    assert completion.answers("scenefw run=predict run.overview=") == [
        "run.overview=false",
        "run.overview=true",
    ]
    assert {"seed=", "size.", "run=", "experiment="} <= set(completion.answers("scenefw "))


def test_answers_need_neither_torch_nor_hydra(tmp_path):
    code = (
        "import sys; from scenefw.__main__ import main; main(['-sc', 'query=bash']);"
        "sys.exit(bool({'torch', 'numpy', 'hydra', 'numba', 'rich'} & set(sys.modules)))"
    )
    line = "scenefw run=predict reconstructor.sam and what is right of the cursor"
    env = {**os.environ, "COMP_LINE": line, "COMP_POINT": str(line.index(" and"))}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "reconstructor.samples=\n"


@pytest.mark.parametrize(
    ("name", "breaks", "expected"),
    [("bash", " =:", "predict"), ("bash", " :", "run=predict"), ("zsh", "", "run=predict")],
)
def test_shells_get_what_they_replace(name, breaks, expected):
    begin = "autoload -U bashcompinit; bashcompinit; " if name == "zsh" else ""
    install = f'eval "$({sys.executable} -m scenefw -sc install={name})"'
    line = "COMP_LINE='python -m scenefw run=pr'; COMP_POINT=24"
    text = f"{begin}{install}; {line}; COMP_WORDBREAKS='{breaks}'; _scenefw_module {sys.executable}"
    assert shell(name, f'{text} 2>/dev/null; echo "${{COMPREPLY[@]}}"') == [expected]


def test_other_commands_of_python_are_left_alone():
    install = f'eval "$({sys.executable} -m scenefw -sc install=bash)"; COMPREPLY=(old)'
    line = "COMP_LINE='python -m pip run=pr'; COMP_POINT=20"
    assert (
        shell("bash", f'{install}; {line}; _scenefw_module python; echo "${{COMPREPLY[@]}}"') == []
    )


def test_settings_of_a_verb_that_sets_others_too_are_completed():
    assert "run.showcase=" in completion.answers("scenefw run=pipeline run.sh")
