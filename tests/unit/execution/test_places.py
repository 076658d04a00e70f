import pytest
from omegaconf import OmegaConf

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.execution.places import require_input, require_no_strangers, require_values


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


def test_a_missing_input_is_named_unless_a_plugin_may_mean_something_else(tmp_path):
    def given(value, target="scenefw.tasks.predict.Predict"):
        require_input(OmegaConf.create({"input": value, "run": {"_target_": target}}))

    for fine in (None, 3, str(tmp_path), str(tmp_path.parent)):
        given(fine)
    given("camera:0", "scenefw_camera.Watch")
    with pytest.raises(InputError, match=r"^no file or folder .*none\.png; give input=PATH"):
        given(str(tmp_path / "none.png"))
