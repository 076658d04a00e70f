"""Plugins written into a folder, and packed by pip: found, run, refused."""

import json
import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from scenefw import plugins
from scenefw.core.errors import ConfigError

ROOT = Path(__file__).parents[1]
EXAMPLES = {"object_count", "point_cloud"}  # plugins that install by themselves
PROJECT = """
[build-system]
requires = ["hatchling"]
build-backend = "hatchling.build"
[project]
name = "scenefw-{name}"
version = "1"
[project.entry-points."scenefw.plugins"]
{name} = "scenefw_{name}"
"""
TASK = """
class Count:
    def __init__(self, upto):
        self.upto = upto

    def run(self):
        return {"counted": sum(range(self.upto + 1))}
"""


def write_plugin(folder, name="counting", option="run/count", code=TASK):
    package = folder / "src" / f"scenefw_{name}"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text('"""A plugin."""\n')
    (package / "count.py").write_text(code)
    file = folder / "conf" / f"{option}.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(f"# Counts to a number\n_target_: scenefw_{name}.count.Count\nupto: 4\n")
    (folder / "pyproject.toml").write_text(PROJECT.format(name=name))
    return folder


@pytest.mark.parametrize("where", ["beside", "elsewhere"])
def test_a_plugin_dropped_in_runs_at_once(scenefw, tmp_path, where):
    folder = tmp_path / ("plugins" if where == "beside" else "mine")
    write_plugin(folder / "counting")
    env = {} if where == "beside" else {"SCENEFW_PLUGINS": str(folder)}
    done = scenefw("run=count", "run.upto=10", "device=cpu", "paths.output=out", env=env)
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "metrics.json").read_text()) == {"counted": 55}


def test_a_broken_plugin_costs_a_warning_only(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "counting")
    broken = tmp_path / "plugins" / "broken"
    broken.mkdir()
    (broken / "pyproject.toml").write_text("[project\n")
    words = "run=count", "device=cpu", "paths.output=out"
    done = scenefw(*words)
    assert done.returncode == 0, done.stderr
    assert [line for line in done.stderr.splitlines() if "left out" in line and "broken" in line]


def test_options_without_a_project_and_a_plugin_in_place_of_its_folder_are_told(scenefw, tmp_path):
    option = tmp_path / "plugins" / "options_alone" / "conf" / "noise" / "mine.yaml"
    option.parent.mkdir(parents=True)
    option.write_text("mine:\n  _target_: scenefw.noise.gaussian.Gaussian\n")
    write_plugin(tmp_path / "others" / "counting")
    env = os.environ | {"SCENEFW_PLUGINS": str(tmp_path / "others" / "counting")}
    done = scenefw("--list", "noise", env=env)
    assert "options_alone is left out: it has no pyproject.toml" in done.stderr
    assert f"counting is left out: it holds no plugins but is one; give {tmp_path}" in done.stderr


def test_faulty_code_of_a_plugin_hurts_only_those_who_use_it(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "counting")
    write_plugin(tmp_path / "plugins" / "bad", "bad", "run/bad", "this is no Python\n")
    assert scenefw("run=count", "device=cpu", "paths.output=out").returncode == 0
    done = scenefw("run=bad", "device=cpu", "paths.output=out", "-v")
    assert done.returncode == 2
    assert "Traceback" in done.stderr
    assert "scenefw_bad" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("code", "word"),
    [
        ("import no_such_library", "install the package that has no_such_library"),
        ("from json import no_such_name", "cannot import name 'no_such_name'"),
        ("raise SystemExit(7)", "SystemExit: 7"),
    ],
)
def test_what_keeps_a_module_from_being_imported_is_told(scenefw, tmp_path, code, word):
    write_plugin(tmp_path / "plugins" / "bad", "bad", "run/bad", f"{code}\n")
    done = scenefw("run=bad", "device=cpu", "paths.output=out")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "scenefw_bad.count.Count" in line
    assert word in line


@pytest.mark.parametrize("same", ["name", "package"])
def test_of_two_plugins_with_one_name_the_second_is_left_out_with_a_word(scenefw, tmp_path, same):
    write_plugin(tmp_path / "plugins" / "a", "counting")
    other = write_plugin(tmp_path / "plugins" / "b", "counting", "run/second")
    project = (other / "pyproject.toml").read_text()
    if same == "package":
        project = project.replace('counting = "', 'second = "')
    else:
        project = project.replace('"scenefw_counting"', '"scenefw_second"')
        (other / "src" / "scenefw_counting").rename(other / "src" / "scenefw_second")
    (other / "pyproject.toml").write_text(project)
    done = scenefw("run=second", "device=cpu", "paths.output=out")
    assert done.returncode == 2
    (line,) = (line for line in done.stderr.splitlines() if "left out" in line)
    assert str(other) in line
    assert f"has its {same} " in line


def test_a_package_with_the_name_of_a_library_is_left_out_with_a_word(scenefw, tmp_path):
    folder = write_plugin(tmp_path / "plugins" / "counting")
    (folder / "src" / "scenefw_counting").rename(folder / "src" / "json")
    project = (folder / "pyproject.toml").read_text().replace("scenefw_counting", "json")
    (folder / "pyproject.toml").write_text(project)
    done = scenefw("run=count")
    assert done.returncode == 2
    (line,) = (line for line in done.stderr.splitlines() if "left out" in line)
    assert "rename the package" in line
    assert scenefw("--list", "floor").returncode == 0


def test_a_package_with_a_dash_works_or_is_told(scenefw, tmp_path):
    folder = write_plugin(tmp_path / "plugins" / "scenefw-counting")
    project = (folder / "pyproject.toml").read_text()
    (folder / "pyproject.toml").write_text(
        project.replace('"scenefw_counting"', '"scenefw-counting"')
    )
    done = scenefw("run=count")
    (line,) = (line for line in done.stderr.splitlines() if "left out" in line)
    assert "the package is scenefw_counting" in line
    (folder / "src" / "scenefw_counting").rename(folder / "src" / "scenefw-counting")
    option = folder / "conf" / "run" / "count.yaml"
    option.write_text(option.read_text().replace("scenefw_counting", "scenefw-counting"))
    done = scenefw("run=count", "device=cpu", "paths.output=out")
    assert done.returncode == 0, done.stderr


def test_files_that_are_not_utf8_are_named(scenefw, tmp_path):
    folder = write_plugin(tmp_path / "plugins" / "counting")
    option = folder / "conf" / "run" / "count.yaml"
    option.write_bytes("# Zählt\n".encode("latin-1") + option.read_bytes())
    done = scenefw("run=count")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert f"{option}: line 1 is not UTF-8" in line
    project = folder / "pyproject.toml"
    project.write_bytes(project.read_bytes() + '# "é"'.encode("latin-1"))
    (line,) = (
        line for line in scenefw("--list", "floor").stderr.splitlines() if "left out" in line
    )
    assert str(folder) in line
    assert "pyproject.toml: line " in line


def test_a_broken_option_is_named_and_hides_no_other(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "bad", "bad", "loss/bad")
    (file := tmp_path / "plugins" / "bad" / "conf" / "loss" / "bad.yaml").write_text("a: [")
    done = scenefw("run=train", "loss=bad")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert str(file) in line
    done = scenefw("--list", "loss")
    assert done.returncode == 0, done.stderr
    assert f"{file} can't be read as YAML" in " ".join(done.stdout.split())
    assert "loss=votes" in done.stdout


def test_an_option_with_a_name_of_the_core_is_refused(scenefw, tmp_path):
    write_plugin(tmp_path / "plugins" / "counting", option="engine/mujoco")
    for words in (("run=count",), ("--list",), ("--help",)):
        done = scenefw(*words)
        assert done.returncode == 2
        assert "engine=mujoco" in done.stderr
        assert len(done.stderr.splitlines()) == 1


def test_two_plugins_with_one_option_are_refused(tmp_path, monkeypatch):
    for name in ("one", "two"):
        write_plugin(tmp_path / name, name)
    monkeypatch.setenv("SCENEFW_PLUGINS", str(tmp_path))
    with pytest.raises(ConfigError, match="run=count"):
        plugins.refuse_clashes(plugins.find())


def test_bundled_plugins_are_in_the_wheel_and_a_checkout_finds_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    bundled = project["project"]["entry-points"]["scenefw.plugins"]
    folders = {path.parent.name for path in (ROOT / "plugins").glob("*/pyproject.toml")}
    assert bundled.keys() == folders - EXAMPLES
    places = {plugin.name: plugin for plugin in plugins.find()}
    for name, package in bundled.items():
        assert f"plugins/{name}/src/{package}" in wheel["packages"]
        assert wheel["force-include"][f"plugins/{name}/conf"] == f"{package}/conf"
        assert places[name].package == package
        assert places[name].conf == ROOT / "plugins" / name / "conf"
    contracts = project["tool"]["importlinter"]["contracts"]
    (apart,) = (c for c in contracts if c["name"] == "The core imports no plugin")
    assert set(bundled.values()) < set(apart["forbidden_modules"])
    for plugin in places.values():
        if plugin.conf.is_relative_to(ROOT):
            assert plugin.package in apart["forbidden_modules"]


def test_a_declared_plugin_whose_folder_is_there_is_not_looked_for_twice(monkeypatch, caplog):
    entry = metadata.EntryPoint("grasping", "scenefw_grasping", plugins.ENTRY_POINTS)
    monkeypatch.setattr(plugins, "_entry_points", lambda _: (entry,))
    monkeypatch.setattr(plugins, "package_dir", lambda package: pytest.fail(package))
    assert [plugin.name for plugin in plugins.find()].count("grasping") == 1
    assert not caplog.records


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A folder with the plugin point_cloud as pip installs it."""
    target = tmp_path_factory.mktemp("installed")
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    how = ["--no-deps", "--no-build-isolation", "--no-index", "--target", str(target)]
    subprocess.run([*pip, *how, str(ROOT / "plugins" / "point_cloud")], check=True)
    return target


@pytest.mark.exhaustive
def test_an_installed_plugin_is_found_without_its_folder(installed, tmp_path):
    code = (
        "import sys; from scenefw import plugins;"
        "plugins.search_folders = lambda: [];"
        "found = plugins.activate(); print(*[(p.name, p.source, p.conf) for p in found]);"
        "assert 'scenefw_point_cloud' not in sys.modules;"
        "from scenefw import registry;"
        "print(registry.describe('run', 'point_cloud'));"
        "from scenefw_point_cloud.representation import PointClouds; print(PointClouds.__name__)"
    )
    env = {**os.environ, "PYTHONPATH": str(installed)}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=env, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "point_cloud" in done.stdout
    assert str(installed) in done.stdout
    assert done.stdout.split()[-1] == "PointClouds"


def test_a_folder_of_plugins_that_is_a_link_to_itself_has_none(tmp_path, monkeypatch):
    (tmp_path / "plugins").symlink_to(tmp_path / "plugins")
    monkeypatch.setenv("SCENEFW_PLUGINS", str(tmp_path / "plugins"))
    assert "object_count" in [plugin.name for plugin in plugins.find()]
