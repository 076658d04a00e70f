import pytest
import torch
from benchmarks import state_parts
from tests.unit.learning import plain

from scenefw.core.errors import CheckpointError
from scenefw.learning.optimizers import Muon


@pytest.fixture
def trained(tmp_path, monkeypatch):
    monkeypatch.setattr(state_parts, "PART", 3000)
    plain.task(tmp_path, steps=6).run()
    return tmp_path


def carried(folder, name, megabytes=None):
    """The state, split and joined in another folder."""
    parts, there = folder / "parts", folder / "there" / "state" / "last.ckpt"
    assert state_parts.split(folder / "state" / "last.ckpt", parts, megabytes) == name
    files = list(parts.iterdir())
    assert len(files) > 1
    assert all(file.stat().st_size <= 3000 for file in files)
    assert state_parts.join(parts, there) == name
    return there.parents[1]


def test_without_a_limit_every_bit_is_kept(trained):
    there = carried(trained, "exact")
    plain.task(trained, steps=9).run()
    plain.task(there, steps=9).run()
    first, second = plain.state(trained), plain.state(there)
    for name, value in first["state_dict"].items():
        assert torch.equal(value, second["state_dict"][name])


@pytest.mark.parametrize(("name", "steps"), [("average", 3), ("rounded", 9)])
def test_steps_are_counted_as_long_as_moments_are_kept(tmp_path, monkeypatch, name, steps):
    monkeypatch.setattr(state_parts, "PART", 3000)
    monkeypatch.setattr(state_parts, "FORMS", {name: state_parts.FORMS[name]})
    options = {"learning": {"optimizer": Muon()}}
    plain.task(tmp_path, steps=6, **options).run()
    assert _counted(tmp_path) == {6}
    there = carried(tmp_path, name)
    plain.task(there, steps=9, **options).run()
    assert _counted(there) == {steps}


def _counted(folder):
    kept = plain.state(folder)["optimizer_states"][0]["state"]
    return {int(moments["step"]) for moments in kept.values() if "step" in moments}


@pytest.mark.parametrize("name", ["rounded", "average"])
def test_a_smaller_state_is_gone_on_with(trained, monkeypatch, name):
    forms = {name: state_parts.FORMS[name]}
    monkeypatch.setattr(state_parts, "FORMS", forms)
    there = carried(trained, name)
    before, after = plain.state(trained), plain.state(there)
    source = before["scenefw"]["average"]["values"] if name == "average" else None
    for key, value in before["state_dict"].items():
        expected = source[key.removeprefix("model.")] if source else value
        torch.testing.assert_close(after["state_dict"][key], expected, rtol=1e-3, atol=1e-5)
    assert plain.task(there, steps=9).run()["train/steps"] == 9
    assert len(plain.state(there)["optimizer_states"][0]["state"]) == 4


def test_the_first_form_that_fits_is_taken(trained, monkeypatch):
    state = trained / "state" / "last.ckpt"
    sizes = {n: torch.rand(size) for n, size in (("exact", 30000), ("rounded", 20000))}
    forms = {n: lambda whole, n=n: {"x": sizes[n]} for n in sizes}
    monkeypatch.setattr(state_parts, "FORMS", forms)
    assert state_parts.split(state, trained / "parts", 0.2) == "exact"
    assert state_parts.split(state, trained / "parts", 0.1) == "rounded"
    with pytest.raises(CheckpointError, match="exact 0 MB, rounded 0 MB"):
        state_parts.split(state, trained / "parts", 0.01)


def test_parts_that_are_missing_are_one_line(trained):
    with pytest.raises(CheckpointError, match=r"no state\.part"):
        state_parts.join(trained / "empty", trained / "last.ckpt")
    state_parts.split(trained / "state" / "last.ckpt", trained / "parts")
    max((trained / "parts").iterdir()).unlink()
    with pytest.raises(CheckpointError, match="incomplete"):
        state_parts.join(trained / "parts", trained / "last.ckpt")


def test_a_network_too_large_to_bring_back_is_refused_before_it_trains():
    wide = ["experiment=simstack", "scale=thesis"]
    with pytest.raises(CheckpointError, match=r"33\.1 million weights.* 66 MB"):
        state_parts.require_room(wide, 59)
    assert state_parts.require_room(wide, 67) > 66
    assert state_parts.require_room([*wide, "size.network=narrow"], 59) < 15
