"""The modifiers of `debug`: each on a tiny training, all together with each kind of run."""

import csv
import json
import pstats

import pytest
from omegaconf import OmegaConf
from safetensors.torch import load_file

from scenefw import config, plugins, registry

TRAIN = ("experiment=simstack", "run=train", "device=cpu")


def test_the_modifiers_that_documents_name():
    expected = {"smoke", "overfit_one_batch", "profile", "fast_dev", "deterministic"}
    assert expected <= set(registry.names("debug"))


# One that trains networks of scenes and of labels, and one of each other kind of run
EXPERIMENTS = ("simstack", "label_maps", "decomposition", "table_6_1", "thesis/scenes_of_six")


@pytest.mark.parametrize("experiment", EXPERIMENTS)
def test_all_at_once_compose_with_every_experiment(experiment):
    plugins.activate()
    every = ",".join(registry.names("debug"))
    whole = config.compose([f"experiment={experiment}", f"debug=[{every}]"])
    assert OmegaConf.to_container(whole.run, resolve=True)
    assert whole.profile
    assert whole.deterministic
    assert whole.size.distinct_batches == 1


@pytest.mark.exhaustive
def test_a_profile_lies_in_the_folder_of_the_run(scenefw, tmp_path):
    done = scenefw(*TRAIN, "debug=[smoke,profile]", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    names = {name for _, _, name in pstats.Stats(str(tmp_path / "out" / "profile.prof")).stats}
    assert {"training_step", "validation_step"} <= names
    assert "cumulative" in (tmp_path / "out" / "profile.txt").read_text()


@pytest.mark.exhaustive
def test_two_deterministic_trainings_give_the_same_weights(scenefw, tmp_path):
    for folder in ("one", "two"):
        words = ("debug=[smoke,deterministic]", "size.steps=3", f"paths.output={folder}")
        done = scenefw(*TRAIN, *words, env={"OMP_NUM_THREADS": "2", "NUMBA_NUM_THREADS": "2"})
        assert done.returncode == 0, done.stderr[-3000:]
    one, two = (load_file(tmp_path / f / "simstack.safetensors") for f in ("one", "two"))
    assert one.keys() == two.keys()
    assert all(one[name].equal(two[name]) for name in one)


@pytest.mark.exhaustive
def test_one_batch_is_learnt_by_heart(scenefw, tmp_path):
    words = (
        "size.steps=30",
        "size.warmup=5",
        "size.validate_every=0",
        "run.log_every=1",
        "paths.output=out",
    )
    done = scenefw(*TRAIN, "debug=[smoke,overfit_one_batch]", *words)
    assert done.returncode == 0, done.stderr[-3000:]
    with (tmp_path / "out" / "losses.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["name"] == "train/votes"]
    losses = [float(row["value"]) for row in rows]
    assert len(losses) == 30
    assert losses[-1] < 0.15 * losses[0]  # of batches that differ it is half by now


@pytest.mark.exhaustive
def test_one_batch_of_everything_at_its_own_resolution(scenefw, tmp_path):
    done = scenefw(*TRAIN, "debug=fast_dev", "paths.output=out")
    assert done.returncode == 0, done.stderr[-3000:]
    figures = json.loads((tmp_path / "out" / "metrics.json").read_text())
    assert figures["train/steps"] == 1
    assert any(name.startswith("val/") for name in figures)
    settings = OmegaConf.load(tmp_path / "out" / "config.yaml")
    assert settings.grid.resolution == 32
    assert not (tmp_path / "outputs").exists()
