import json

import numpy as np
import pytest
from omegaconf import OmegaConf

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.execution.places import require_input, require_no_strangers, require_values, strangers


@pytest.mark.parametrize(
    "word", ["paths.output=", "input=", "input=''", 'paths.output=""', "+run.note= "]
)
def test_a_setting_without_a_value_is_refused(word):
    key = word.partition("=")[0]
    with pytest.raises(ConfigError, match=rf"^{key.replace('+', '.')}= has no value; give"):
        require_values(["run=predict", word])


def test_settings_with_values_and_groups_that_are_left_out_are_fine():
    require_values(
        ["~settling", "input=a=b", "run.note=null", "seed=0", "hydra.job.name=", "run.note=''"]
    )


@pytest.mark.parametrize("name", ["config.yaml", "metrics.json", "measures.json", "report.html"])
def test_a_file_of_somebody_else_in_the_place_of_a_runs_is_refused(tmp_path, name):
    (tmp_path / "notes.txt").touch()
    require_no_strangers(tmp_path)
    (tmp_path / name).touch()
    with pytest.raises(StorageError, match=rf"{name} is not of a run of scenefw"):
        require_no_strangers(tmp_path)
    (tmp_path / "run.json").touch()
    require_no_strangers(tmp_path)


@pytest.mark.parametrize("content", ["mine", "3", "[]", "{}", '{"command": "make"}', "\xff"])
def test_a_record_of_another_program_is_of_somebody_else(tmp_path, content):
    files = {tmp_path / name for name in ("run.json", "config.yaml", "metrics.json")}
    for file in files:
        file.write_bytes(content.encode("latin-1"))
    assert set(strangers(tmp_path)) == files
    with pytest.raises(StorageError, match=r"run\.json is not of a run of scenefw .* be lost"):
        require_no_strangers(tmp_path)


def test_a_run_touches_nothing_beside_a_record_of_another_program(tmp_path, scenefw):
    (tmp_path / "out").mkdir()
    for name in ("run.json", "config.yaml", "metrics.json"):
        (tmp_path / "out" / name).write_text("mine")
    done = scenefw("run=predict", "input=example", "paths.output=out")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "run.json is not of a run of scenefw" in line
    assert [file.read_text() for file in (tmp_path / "out").iterdir()] == ["mine"] * 3


def test_what_was_there_before_the_first_run_is_of_somebody_else(tmp_path):
    assert strangers(tmp_path / "none") == []
    mine = tmp_path / "map.npz"
    mine.touch()
    (tmp_path / "folder").mkdir()
    assert strangers(tmp_path) == [mine]
    record = {"seed": 0, "versions": {}, "command": []}
    further = record | {"kept": ["map.npz", "gone"]}
    for text, expected in [("", []), (json.dumps(record), []), (json.dumps(further), [mine])]:
        (tmp_path / "run.json").write_text(text)
        assert strangers(tmp_path) == expected


@pytest.mark.exhaustive
def test_a_run_never_replaces_what_was_there_before(tmp_path, scenefw):
    (tmp_path / "out").mkdir()
    for name in ("blocks.png", "blocks"):
        (tmp_path / "out" / name).write_text("mine")
    depth = np.full((60, 80), 0.8)
    depth[20:40, 20:45] = 0.7
    np.savez(tmp_path / "blocks.npz", depth=depth, K=[[75, 0, 39.5], [0, 75, 29.5], [0, 0, 1]])
    for _ in range(2):
        done = scenefw("run=doctor", "input=blocks.npz", "paths.output=out")
        assert done.returncode == 2
        (line,) = done.stderr.splitlines()
        assert "blocks.png is not of a run of scenefw, and would be lost; give another" in line
        assert (tmp_path / "out" / "blocks.png").read_text() == "mine"
    (tmp_path / "out" / "blocks.png").unlink()
    for _ in range(2):  # and then its own
        assert scenefw("run=doctor", "input=blocks.npz", "paths.output=out").returncode == 0
    kept = json.loads((tmp_path / "out" / "run.json").read_text())["kept"]
    assert kept == ["blocks"]


def test_a_missing_input_is_named_unless_a_plugin_may_mean_something_else(tmp_path):
    def given(value, target="scenefw.tasks.predict.Predict"):
        require_input(OmegaConf.create({"input": value, "run": {"_target_": target}}))

    for fine in (None, 3, str(tmp_path), str(tmp_path.parent)):
        given(fine)
    given("camera:0", "scenefw_camera.Watch")
    with pytest.raises(InputError, match=r"^no file or folder .*none\.png; give input=PATH"):
        given(str(tmp_path / "none.png"))


@pytest.mark.parametrize(
    ("path", "advice"),
    [
        ("$NOWHERE/a.npz", "outside single quotes"),
        ("https://example.org/a.npz", "addresses are not read"),
        ("images/*.npz", "input=FOLDER"),
        ("a.npz", "one that is there"),
    ],
)
def test_signs_of_another_notation_are_told(path, advice):
    settings = OmegaConf.create({"run": {"_target_": "scenefw.tasks.predict.Predict"}})
    settings.input = path
    with pytest.raises(InputError, match=f"no file or folder .*{advice}"):
        require_input(settings)
