"""The queue of trainings: whose turn it is, legs, and what is left after a kill."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
import torch
from benchmarks import train_next, train_on_gpu, trainings
from benchmarks.legs import start_of, steps_per_second
from benchmarks.trainings import STATE, Ledger, Machine, Training, markdown, write_into
from omegaconf import OmegaConf
from tests.test_guide import FILES
from tests.unit.learning import plain

from scenefw import config, plugins, registry
from scenefw.core.errors import ConfigError
from scenefw.learning.runtime.state import write_state

ENTRY = """
{name}:
  purpose: a test
  command: [experiment=none]
  weight: {weight}
  samples: 1000
  figure: val/error
  core: {{samples_per_second: {speed}}}
  gpu: {{samples_per_second: 100.0, part: {part}}}
"""


def ledger(folder, seen, weights=(1.0, 1.0, 2.0), parts=(0.5, 0.6, 0.4), speed=1.0):
    names = "abc"
    texts = [
        ENTRY.format(name=n, weight=w, speed=speed, part=p)
        for n, w, p in zip(names, weights, parts, strict=True)
    ]
    (folder / "trainings.yaml").write_text("".join(texts))
    lines = [
        json.dumps({"training": n, "samples": [0, s], "curve": [[s, 0.5]]})
        for n, s in zip(names, seen, strict=True)
        if s
    ]
    (folder / "legs.jsonl").write_text("".join(line + "\n" for line in lines))
    return Ledger(folder / "trainings.yaml")


@pytest.mark.parametrize(
    ("seen", "order"),
    [((0, 10, 10), "acb"), ((10, 10, 30), "abc"), ((999, 30, 50), "cba"), ((1000, 30, 50), "cb")],
)
def test_the_training_with_the_least_time_for_its_weight_comes_first(tmp_path, seen, order):
    assert [t.name for t in ledger(tmp_path, seen).overdue()] == list(order)


def test_time_is_counted_in_hours_of_a_core_wherever_it_was_spent(tmp_path):
    assert ledger(tmp_path, (720, 0, 0), speed=0.1).hours("a") == pytest.approx(2.0)


def test_a_gpu_is_filled(tmp_path):
    found = ledger(tmp_path, (0, 10, 50))
    assert [t.name for t in train_on_gpu.chosen(found, [])] == ["a", "c"]
    assert [t.name for t in train_on_gpu.chosen(found, ["b", "a"])] == ["b", "a"]


def test_a_promise_follows_the_power_of_the_samples():
    curve = [(n, 1 - 8 * n**-0.5) for n in (100, 400, 600, 1000, 1200)]
    assert trainings.promise(curve, 10) == f"{1 - 8 * 12000**-0.5:.2f}"
    assert trainings.promise(curve, 100) == f"{1 - 8 * 120000**-0.5:.2f}"
    assert trainings.promise(curve[:2], 10) == ""
    assert trainings.promise([(n, 5.0) for n, _ in curve], 10) == ""


def test_a_leg_is_a_line_and_the_table_shows_its_curve(tmp_path):
    found = ledger(tmp_path, (0, 10, 50))
    found.add({"training": "a", "samples": [0, 300], "curve": [[100, 0.25], [300, 0.75]]})
    again = Ledger(tmp_path / "trainings.yaml")
    assert again.samples("a") == 300
    assert again.curve("a") == [(100, 0.25), (300, 0.75)]
    heading, *rows = again.table()
    (row,) = (row for row in rows if row[0] == "a")
    assert row[heading.index("first")] == "0.250 (100)"
    assert row[heading.index("last")] == "0.750 (300)"
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- trainings -->\nold\n<!-- end of trainings -->\nafter\n")
    write_into(page, again.table())
    text = page.read_text()
    assert "old" not in text
    assert markdown(again.table()) in text
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    with pytest.raises(ConfigError, match="add both lines"):
        write_into(tmp_path / "trainings.yaml", again.table())


@pytest.mark.parametrize("text", ["a: 1", "[]", "a: {purpose: x}", "a: ["])
def test_another_ledger_is_one_line(tmp_path, text):
    (tmp_path / "trainings.yaml").write_text(text)
    with pytest.raises(ConfigError, match="can't be read"):
        Ledger(tmp_path / "trainings.yaml")


def test_entries_of_the_ledger_compose_on_both_machines():
    plugins.activate()  # recipes of chapter 4 are evaluated by a plugin
    found = Ledger()
    assert sum(t.weight for t in found.trainings.values()) == pytest.approx(1.0)
    for training in found.trainings.values():
        experiment = training.command[0].removeprefix("experiment=")
        assert experiment in registry.names("experiment")
        networks = []
        for machine in (training.core, training.gpu):
            fresh = ["learning.schedule.warmup=500", "learning.initial=weights.safetensors"]
            whole = config.compose([*training.words(machine), *fresh])
            assert whole.paths.weights == training.name
            networks.append(OmegaConf.to_container(whole.model, resolve=True))
        assert networks[0] == networks[1], "one network for both machines"


def test_every_leg_of_the_ledger_is_of_a_training():
    found = Ledger()
    assert {leg["training"] for leg in found.legs} <= set(found.trainings)
    assert found.legs, "nothing is trained"


def test_the_documented_table_is_the_ledger():
    text = trainings.DOCUMENT.read_text(encoding="utf-8")
    assert markdown(Ledger().table()) in text, "python -m benchmarks.trainings --write"


@pytest.fixture
def training():
    machine = Machine(1.0)
    return Training("plain", "a test", ["experiment=none"], 1.0, 10, "val/error", machine, machine)


def test_a_damaged_state_is_moved_aside_for_the_one_before(tmp_path, training, capsys):
    folder = tmp_path / "state"
    plain.task(tmp_path, steps=4).run()
    assert start_of(training, folder).samples == 16
    good = (folder / STATE).read_bytes()
    (folder / STATE).unlink()  # as a training replaces it: the other name keeps the old one
    (folder / STATE).write_bytes(good[:2000])
    start = start_of(training, folder)
    assert start.samples == 16
    assert (folder / STATE).read_bytes() == good
    assert (folder / "damaged.ckpt").read_bytes() == good[:2000]
    assert "damaged" in capsys.readouterr().out.splitlines()[-1]


def test_without_a_state_the_weights_that_ship_are_the_start(tmp_path, training):
    assert start_of(training, tmp_path).words == []
    plain.task(tmp_path, steps=4).run()
    weights = tmp_path / "out" / "plain.safetensors"
    start = start_of(replace(training, weights=str(weights)), tmp_path / "none")
    assert start.samples == 16
    assert start.words == [
        f"learning.initial={weights}",
        "learning.schedule.warmup=500",
    ]
    assert "fresh optimiser" in start.line


def test_samples_of_weights_that_started_from_weights_add_up(tmp_path, training):
    state = {"samples_seen": 5, "batches_seen": 1}
    chain = {"samples": 100, "started_from": {"samples": 1000, "started_from": None}}
    write_state(tmp_path / STATE, {"scenefw": {**state, "started_from": chain}})
    start = start_of(training, tmp_path)
    assert start.samples == 1105
    assert start.words == ["learning.schedule.warmup=500"]


def test_too_little_time_is_one_line(tmp_path, training):
    with pytest.raises(ConfigError, match=r"--minutes 0\.2 leaves no time to train"):
        train_next.train(ledger(tmp_path, (0, 0, 0)), training, 0.2)


QUEUE = """
litres:
  purpose: the network of the guide to plugins
  command: [experiment=litres, run=train, debug=smoke, trainer.max_steps=8, run.snapshot_steps=2]
  weight: 1
  samples: 1000
  figure: val/error
  core: {samples_per_second: 10}
  gpu: {samples_per_second: 10}
"""


@pytest.mark.exhaustive
def test_a_network_of_a_plugin_killed_in_the_queue_ends_as_if_it_was_not(tmp_path):
    for name, text in FILES.items():
        (path := tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "trainings.yaml").write_text(QUEUE)
    killed, whole = queue(tmp_path, "killed"), queue(tmp_path, "whole")
    state = tmp_path / "killed" / "litres" / STATE
    deadline = time.monotonic() + 240
    while not state.exists() and killed.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(killed.pid, signal.SIGKILL)
    assert state.exists()
    assert whole.wait() == 0
    assert queue(tmp_path, "killed").wait() == 0
    one, other = (torch.load(tmp_path / n / "litres" / STATE) for n in ("killed", "whole"))
    assert one["scenefw"]["batches_seen"] == other["scenefw"]["batches_seen"] == 8
    for name, value in other["state_dict"].items():
        assert torch.equal(one["state_dict"][name], value)
    legs = Ledger(tmp_path / "trainings.yaml").legs
    assert [leg["samples"][1] for leg in legs] == [16, 16]


@pytest.mark.exhaustive
def test_trainings_of_the_ledger_go_through_the_script_of_gpus_on_a_cpu(tmp_path, warm):
    names = ("thesis_simstack", "thesis_label_maps")
    entries = OmegaConf.masked_copy(OmegaConf.load(trainings.LEDGER), names)
    for entry in entries.values():
        entry.command += ["debug=smoke", "run.snapshot_steps=1"]
        entry.needs, entry.core.changes = {}, []
    for folder in ("there", "here"):
        (tmp_path / folder).mkdir()
        OmegaConf.save(entries, tmp_path / folder / "trainings.yaml")

    def run(folder, *words):
        own = {**os.environ, "SCENEFW_TRAININGS": str(tmp_path / folder / "states")}
        given = (tmp_path / "parts", "--ledger", tmp_path / folder / "trainings.yaml", *words)
        done = warm("benchmarks.train_on_gpu", given, trainings.HERE.parent, own)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]

    run("there", "--trainer", "cpu", "--limit", "300", "--training", *entries)
    run("here", "--receive")
    found = Ledger(tmp_path / "here" / "trainings.yaml")
    assert {leg["training"] for leg in found.legs} == set(entries)
    for leg in found.legs:
        began, ended = leg["samples"]  # from committed weights, where a training has some
        assert ended - began == 4
        assert leg["validation"]
        assert (tmp_path / "here" / "states" / leg["training"] / STATE).exists()


def queue(folder, states):
    words = ["--minutes", "4", "--ledger", str(folder / "trainings.yaml")]
    root = str(trainings.HERE.parent)
    paths = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH", "")]))
    own = {"SCENEFW_TRAININGS": str(folder / states), "PYTHONPATH": paths}
    command = [sys.executable, "-m", "benchmarks.train_next", *words]
    return subprocess.Popen(command, cwd=folder, env=os.environ | own, start_new_session=True)


def test_a_leg_that_was_stopped_has_the_speed_of_its_table(tmp_path):
    table = tmp_path / "losses.csv"
    rows = [(10, 5.0), (20, 10.0), (30, 20.0), (50, 40.0)]
    table.write_text(
        "step,epoch,seconds,name,value\n" + "".join(f"{s},0,{t},loss,1.0\n" for s, t in rows)
    )
    assert steps_per_second(table, 15) == pytest.approx(1.0)
    assert steps_per_second(table, 50) == 0.0
    assert steps_per_second(tmp_path / "none.csv", 0) == 0.0
