import pytest
import torch
from benchmarks import travel
from benchmarks.trainings import STATE
from tests.unit.learning import plain

from scenefw.core.errors import CheckpointError
from scenefw.learning.optimizers import Muon

FULL, SMALL = 1.0, 1e-9  # MB, and less than any state


@pytest.fixture
def trained(tmp_path, monkeypatch):
    monkeypatch.setattr(travel, "PART", 3000)
    plain.task(tmp_path, steps=6).run()
    return tmp_path


def carried(folder, form):
    """The state, packed in a form and unpacked in another folder."""
    parts, there = folder / "parts", folder / "there"
    state = folder / "state" / STATE
    room = FULL if form == "exact" else size_of(form, state)
    assert travel.pack({"state": state}, parts, room) == {"state": form}
    files = list(parts.iterdir())
    assert len(files) > 1
    assert all(file.stat().st_size <= 3000 for file in files)
    assert travel.unpack(parts, there) == ({"state": form}, {})
    return there


def size_of(form, state):
    """MB of a form, as `pack` writes it."""
    small = travel._bytes(travel.FORMS[form](travel.read_state(state)))
    load = {"states": {"state": small}, "forms": {"state": form}, "extra": {}}
    return len(travel._bytes(load)) / 1e6


def test_an_exact_state_keeps_every_bit(trained):
    there = carried(trained, "exact")
    plain.task(trained, steps=9).run()
    plain.task(there, steps=9).run()
    first, second = plain.state(trained), plain.state(there)
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name])


@pytest.mark.parametrize("form", ["rounded", "factored"])
@pytest.mark.parametrize("optimizer", [None, Muon()])
def test_a_smaller_state_is_gone_on_with(tmp_path, monkeypatch, form, optimizer):
    monkeypatch.setattr(travel, "PART", 3000)
    options = {"learning": {"optimizer": optimizer}}
    plain.task(tmp_path, steps=6, **options).run()
    there = carried(tmp_path, form)
    before, after = plain.state(tmp_path), plain.state(there)
    for name, value in before["state_dict"].items():
        torch.testing.assert_close(after["state_dict"][name], value, rtol=1e-3, atol=1e-5)
    assert plain.task(there, steps=9, **options).run()["train/steps"] == 9
    kept = plain.state(there)["optimizer_states"][0]["state"]
    assert len(kept) == 4
    assert {int(moments["step"]) for moments in kept.values() if "step" in moments} == {9}


def test_second_moments_are_their_means_over_rows_and_columns(trained):
    there = carried(trained, "factored")
    before, after = (plain.state(f)["optimizer_states"][0]["state"] for f in (trained, there))
    assert len(before) == 4
    for number, moments in before.items():
        second, stored = moments["exp_avg_sq"], after[number]["exp_avg_sq"]
        assert stored.shape == second.shape
        for axis in range(second.ndim):
            torch.testing.assert_close(stored.mean(axis), second.mean(axis), rtol=1e-3, atol=1e-9)
        assert not after[number]["exp_avg"].any()
    rank = torch.linalg.matrix_rank(after[0]["exp_avg_sq"])
    assert rank == 1


def test_the_largest_state_gets_smaller_first(tmp_path):
    states = {}
    for name, size in (("large", 4000), ("small", 1000)):
        states[name] = tmp_path / name / STATE
        state = {
            "scenefw": {"average": {"updates": 1, "values": {"w": torch.rand(size)}}},
            "state_dict": {"w": torch.rand(size)},
            "optimizer_states": [],
        }
        travel.write_state(states[name], state)
    forms = [travel.pack(states, tmp_path / "parts", room) for room in (0.1, 0.04, 0.025, 0.0185)]
    assert [list(form.values()) for form in forms] == [
        ["exact", "exact"], ["rounded", "exact"], ["factored", "exact"], ["factored", "rounded"],
    ]  # fmt: skip
    with pytest.raises(CheckpointError, match=r"large, small take 0\.0 MB in their smallest form"):
        travel.pack(states, tmp_path / "parts", SMALL)


def test_parts_that_are_missing_are_one_line(trained):
    with pytest.raises(CheckpointError, match=r"no trainings\.part"):
        travel.unpack(trained / "empty", trained / "there")
    travel.pack({"state": trained / "state" / STATE}, trained / "parts", FULL)
    max((trained / "parts").iterdir()).unlink()
    with pytest.raises(CheckpointError, match="incomplete"):
        travel.unpack(trained / "parts", trained / "there")
    assert not (trained / "there").exists()


def test_what_else_travels_arrives(trained):
    extra = {"legs": {"state": {"files": {"losses.csv": b"step"}}}}
    travel.pack({"state": trained / "state" / STATE}, trained / "parts", FULL, extra)
    assert travel.unpack(trained / "parts", trained / "there") == ({"state": "exact"}, extra)


def test_parts_take_no_more_than_they_may(trained):
    state = trained / "state" / STATE
    extra = {"files": {"weights": bytes(range(256)) * 400}}
    travel.pack({"state": state}, trained / "parts", 0.12, extra)
    assert sum(part.stat().st_size for part in (trained / "parts").iterdir()) <= 120_000
    assert travel.unpack(trained / "parts", trained / "there")[1] == extra
