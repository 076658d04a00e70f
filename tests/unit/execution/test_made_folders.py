import pytest
from omegaconf import OmegaConf

from scenefw.execution import made_folders
from scenefw.execution.made_folders import MadeFolders, empty_ones_removed


@pytest.fixture(autouse=True)
def nothing_noted(monkeypatch):
    monkeypatch.setattr(made_folders, "_noted", made_folders._Noted())


def settings(folder):
    return OmegaConf.create({"hydra": {"run": {"dir": str(folder)}, "sweep": {"dir": str(folder)}}})


def test_folders_that_were_made_and_stay_empty_go(tmp_path):
    (tmp_path / "mine").mkdir()

    @empty_ones_removed()
    def refused(folder):
        MadeFolders().on_run_start(settings(folder))
        folder.mkdir(parents=True)
        raise SystemExit(2)

    with pytest.raises(SystemExit):
        refused(tmp_path / "mine" / "day" / "time")
    assert list(tmp_path.rglob("*")) == [tmp_path / "mine"]


def test_what_holds_something_or_was_there_stays(tmp_path):
    old, new = tmp_path / "old", tmp_path / "day" / "time"
    old.mkdir()
    for folder in (old, new):
        with empty_ones_removed():
            MadeFolders().on_run_start(settings(folder))
            new.mkdir(parents=True, exist_ok=True)
            (new / "run.json").write_text("{}")
    assert old.is_dir()
    assert (new / "run.json").is_file()


@pytest.mark.parametrize("there", [False, True])
def test_a_refused_sweep_leaves_nothing(tmp_path, there):
    sweep = tmp_path / "day" / "time"
    if there:
        (sweep / "7").mkdir(parents=True)
    with empty_ones_removed():
        MadeFolders().on_multirun_start(settings(sweep))
        (sweep / "0").mkdir(parents=True)
        (sweep / "multirun.yaml").write_text("")
    kept = [tmp_path / "day", sweep, sweep / "7"] if there else []
    assert sorted(tmp_path.rglob("*")) == kept


def test_a_sweep_with_results_keeps_its_record(tmp_path):
    with empty_ones_removed():
        MadeFolders().on_multirun_start(settings(tmp_path / "sweep"))
        for run in ("0", "1"):
            (tmp_path / "sweep" / run).mkdir(parents=True)
        (tmp_path / "sweep" / "1" / "run.json").write_text("{}")
        (tmp_path / "sweep" / "multirun.yaml").write_text("")
    found = {str(path.relative_to(tmp_path / "sweep")) for path in tmp_path.rglob("*.*")}
    assert found == {"1/run.json", "multirun.yaml"}
    assert not (tmp_path / "sweep" / "0").exists()


@pytest.mark.parametrize("words", [(), ("-m", "seed=1,2")])
def test_a_folder_that_the_user_made_stays_as_it_was(scenefw, tmp_path, words):
    (tmp_path / "mine").mkdir()
    assert scenefw("run=predict", "paths.output=mine", *words).returncode == 2
    assert list(tmp_path.rglob("*")) == [tmp_path / "mine"]


@pytest.mark.parametrize("words", [(), ("-m", "seed=1,2", "paths.output=a/b")])
def test_a_refused_command_leaves_no_folder(scenefw, tmp_path, words):
    result = scenefw("run=predict", *words)
    assert result.returncode == 2
    assert list(tmp_path.iterdir()) == []
