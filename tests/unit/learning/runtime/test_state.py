import io
import os
import pickle
from collections import OrderedDict

import numpy as np
import pytest
import torch
from benchmarks import travel
from tests.unit.learning import plain

from scenefw.core.errors import CheckpointError, StorageError
from scenefw.learning.runtime.state import StateFiles, read_state, state_to_go_on, write_state


class Planted:
    """Makes a file where it is unpickled."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.system, (f"touch {self.mark}",)


def planted(state, mark, form):
    """A state as a training wrote it, with code in it; or a bare pickle."""
    whole = torch.load(state, weights_only=True) if state.exists() else {}
    state.parent.mkdir(parents=True, exist_ok=True)
    if form == "zip":
        torch.save({**whole, "scenefw": {**whole.get("scenefw", {}), "x": Planted(mark)}}, state)
    elif form == "legacy":
        torch.save({"x": Planted(mark)}, state, _use_new_zipfile_serialization=False)
    else:
        state.write_bytes(pickle.dumps(Planted(mark)))


def test_the_plant_works(tmp_path):
    planted(tmp_path / "state", tmp_path / "mark", "zip")
    torch.load(tmp_path / "state", weights_only=False)
    assert (tmp_path / "mark").exists()


@pytest.mark.parametrize("mapped", [False, True])
@pytest.mark.parametrize("form", ["zip", "legacy", "pickle"])
def test_code_in_a_state_does_not_run(tmp_path, form, mapped):
    planted(tmp_path / "state", tmp_path / "mark", form)
    with pytest.raises(CheckpointError, match=r"run\.fresh=true") as caught:
        read_state(tmp_path / "state", mapped=mapped)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "mark").exists()


def test_code_in_a_state_does_not_run_where_the_trainer_reads_it(tmp_path):
    plain.task(tmp_path, steps=2).run()
    state = tmp_path / "state" / "last.ckpt"
    planted(state, tmp_path / "mark", "zip")
    with pytest.raises(CheckpointError, match="could run code"):
        plain.task(tmp_path, steps=4)._fit()  # what other processes of a training begin with
    assert not (tmp_path / "mark").exists()


@pytest.mark.parametrize("form", ["zip", "pickle"])
def test_code_in_a_state_ends_the_command_with_one_line(tmp_path, scenefw, form):
    planted(tmp_path / "training" / "last.ckpt", tmp_path / "mark", form)
    words = ("experiment=simstack", "run=train", "debug=smoke", "device=cpu", "trainer=default")
    done = scenefw(*words, "paths.training=training", "paths.output=out")
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "run.fresh=true" in done.stderr
    assert not (tmp_path / "mark").exists()


def test_code_in_parts_of_a_state_does_not_run(tmp_path):
    planted(tmp_path / "parts" / "trainings.part000", tmp_path / "mark", "zip")
    planted(tmp_path / "last.ckpt", tmp_path / "mark", "zip")
    with pytest.raises(CheckpointError, match="are damaged or incomplete"):
        travel.unpack(tmp_path / "parts", tmp_path / "new")
    with pytest.raises(CheckpointError, match="not a state of a training"):
        travel.pack({"state": tmp_path / "last.ckpt"}, tmp_path / "new", 1.0)
    assert not (tmp_path / "mark").exists()
    assert not (tmp_path / "new").exists()


def test_what_is_written_is_read(tmp_path):
    weights = torch.nn.BatchNorm1d(3).state_dict()
    state = {"weights": weights, "n": [1, 0.5, (True, None, "x", b"y")], "o": OrderedDict(a=1)}
    write_state(tmp_path / "state", state)
    for found in (read_state(tmp_path / "state"), read_state(tmp_path / "state", mapped=True)):
        assert found["n"] == state["n"]
        assert found["o"] == state["o"]
        assert all(torch.equal(found["weights"][k], v) for k, v in weights.items())
        assert found["weights"]._metadata == weights._metadata
    with io.BytesIO((tmp_path / "state").read_bytes()) as file:
        assert read_state(file)["n"] == state["n"]
    StateFiles().remove_checkpoint(tmp_path / "state")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [np.float64(1.0), {1, 2}, np.zeros(2), Planted("x"), print])
def test_what_could_not_be_read_is_not_written(tmp_path, value):
    with pytest.raises(CheckpointError, match=r"scenefw\.facts\[0\] is a"):
        write_state(tmp_path / "state", {"scenefw": {"facts": [value]}})
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_something_else_is_damaged(tmp_path):
    torch.save([1, 2], tmp_path / "list")
    (tmp_path / "text").write_text("no state")
    (tmp_path / "empty").write_text("")
    for name in ("list", "text", "empty", "none"):
        with pytest.raises(CheckpointError, match=r"run\.fresh=true"):
            read_state(tmp_path / name)
    torch.save({"state_dict": {}}, tmp_path / "bare.ckpt")
    with pytest.raises(CheckpointError, match=r"run\.fresh=true"):
        state_to_go_on(tmp_path / "bare.ckpt", {}, {})


def test_parts_of_another_file_are_one_line(tmp_path):
    torch.save({"x": 1}, tmp_path / "trainings.part000")
    with pytest.raises(CheckpointError, match="hold no trainings"):
        travel.unpack(tmp_path, tmp_path / "new")


def test_a_full_disk_leaves_the_old_state_alone(tmp_path, full_disk):
    write_state(tmp_path / "state", {"n": 1})
    with full_disk(5000), pytest.raises(StorageError, match="state: File too large"):
        write_state(tmp_path / "state", {"x": torch.zeros(5000)})
    assert read_state(tmp_path / "state") == {"n": 1}
    assert [p.name for p in tmp_path.iterdir()] == ["state"]


def test_a_training_on_a_full_disk_keeps_its_last_snapshot(tmp_path, full_disk):
    plain.task(tmp_path, steps=2).run()
    folder = tmp_path / "state"
    state, there = (folder / "last.ckpt").read_bytes(), {p.name for p in folder.iterdir()}
    room = (folder / "losses.csv").stat().st_size + 200  # of a snapshot there is more
    with full_disk(room), pytest.raises(StorageError, match=r"last\.ckpt: File too large"):
        plain.task(tmp_path, steps=4).run()
    assert (folder / "last.ckpt").read_bytes() == state
    assert {p.name for p in folder.iterdir()} == there
    with full_disk(room - 200), pytest.raises(StorageError, match=r"losses\.csv: File too large"):
        plain.task(tmp_path, steps=4).run()
    assert plain.task(tmp_path, steps=4).run()["train/steps"] == 4


def whole(recipe, facts):
    own = {"batches_seen": 1, "samples_seen": 2, "seconds": 1.0, "batches_per_epoch": 3}
    parts = {"state_dict": {}, "optimizer_states": [], "loops": {}, "global_step": 1}
    return {**parts, "scenefw": {**own, "recipe": recipe, "facts": facts}}


def test_a_setting_that_is_left_out_now_is_another_setting(tmp_path):
    """A training on a few batches says so; one on all of them says nothing."""
    kept = whole({"width": 8}, {"seed": 0, "distinct_batches": 2, "steps": 1, "commit": "abc"})
    write_state(tmp_path / "state", kept)
    assert state_to_go_on(
        tmp_path / "state", {"width": 8}, {"seed": 0, "distinct_batches": 2}
    )["global_step"] == 1  # fmt: skip
    with pytest.raises(CheckpointError, match="distinct_batches 2 instead of None"):
        state_to_go_on(tmp_path / "state", {"width": 8}, {"seed": 0})
    with pytest.raises(CheckpointError, match=r"different network \(width\)"):
        state_to_go_on(tmp_path / "state", {}, {"seed": 0, "distinct_batches": 2})


@pytest.mark.parametrize(
    "part", ["state_dict", "optimizer_states", "loops", "global_step", "scenefw", "seconds"]
)
def test_a_state_without_a_part_is_damaged(tmp_path, part):
    kept = whole({}, {})
    kept["scenefw"].pop(part, None)
    kept.pop(part, None)
    write_state(tmp_path / "state", kept)
    with pytest.raises(CheckpointError, match=r"state is damaged .*run\.fresh=true") as caught:
        state_to_go_on(tmp_path / "state", {}, {})
    assert "\n" not in str(caught.value)
