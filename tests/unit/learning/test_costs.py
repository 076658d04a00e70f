import itertools
from pathlib import Path

import pytest
import torch
from tests.unit.learning import plain
from torch.utils._python_dispatch import TorchDispatchMode

from scenefw.core.batches import SegmentationBatch, ShapeInstanceBatch
from scenefw.learning import costs
from scenefw.learning.costs import SideStream, StepTimes, peak_memory

CPU = torch.device("cpu")


class Reads(TorchDispatchMode):
    """Notes operations that bring a number to the host, which on a GPU waits for all before it."""

    def __init__(self):
        super().__init__()
        self.found = []

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        if str(function) in ("aten._local_scalar_dense.default", "aten.nonzero.default"):
            self.found.append(str(function))
        return function(*args, **(kwargs or {}))


def reads_of_a_training(folder, log_every):
    task = plain.task(folder, steps=10, gradient_clip=1.0, validate_every=0)
    task.log_every = log_every
    with Reads() as reads:
        before = task.learning.on_train_batch_start
        ends = []
        task.learning.on_train_batch_start = lambda *a: (ends.append(len(reads.found)), before(*a))
        task.run()
    return [later - earlier for earlier, later in itertools.pairwise(ends)]


def test_a_step_brings_no_number_to_the_host(tmp_path):
    assert reads_of_a_training(tmp_path / "silent", 1000) == [0] * 9
    assert max(reads_of_a_training(tmp_path / "told", 5)) > 0  # the table does, when it is written


def test_time_is_split_into_waiting_and_computing(monkeypatch):
    now = iter([1.0, 3.0, 6.0, 10.0, 11.0, 20.0])
    monkeypatch.setattr(costs.time, "perf_counter", lambda: next(now))
    times = StepTimes()
    for _ in range(2):
        times.begin(CPU)
        times.mark_data(CPU)
        times.end(CPU)
    times.finish()
    assert (times.data, times.network) == (3.0, 12.0)
    assert times.share_of_data == pytest.approx(0.2)


def test_events_are_read_two_steps_later(monkeypatch):
    waited = []

    class Event:
        def __init__(self, number):
            self.number = number

        def synchronize(self):
            waited.append(self.number)

        def elapsed_time(self, other):
            return 1e3 * (other.number - self.number)

    numbers = iter(range(100))
    monkeypatch.setattr(costs, "_mark", lambda device: Event(next(numbers)))
    times = StepTimes()
    for step in range(4):
        times.begin(CPU)
        assert max(waited, default=-1) <= max(3 * step - 4, -1)  # of the step before the last
        times.mark_data(CPU)
        times.end(CPU)
    times.finish()
    assert (times.data, times.network) == (4.0, 4.0)


def test_the_figures_say_what_it_costs(tmp_path):
    figures = plain.task(tmp_path, steps=6).run()
    assert figures["train/samples_per_second"] > 0
    assert 0 <= figures["train/share_of_data"] <= 1
    assert 50 < figures["train/memory_mb"] < 1e5


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="Linux says it there")
def test_the_peak_of_memory_is_what_the_system_says():
    lines = Path("/proc/self/status").read_text().splitlines()
    (peak,) = (int(line.split()[1]) for line in lines if line.startswith("VmHWM"))
    assert peak_memory(CPU) == pytest.approx(1024 * peak, rel=0.02)


def test_every_tensor_of_a_batch_is_kept_for_the_network():
    """On CUDA its memory must not be given away before the network has used it."""
    condition, tsdf, votes = (torch.zeros(n) for n in (1, 2, 3))
    batch = ShapeInstanceBatch(condition, {"tsdf": tsdf, "votes": votes})
    assert [len(t) for t in costs._tensors(batch)] == [1, 2, 3]
    labels = SegmentationBatch(condition, tsdf, votes)
    assert [len(t) for t in costs._tensors(labels)] == [1, 2, 3]


def test_on_a_cpu_data_are_made_at_once():
    assert SideStream().run(CPU, lambda: "made") == "made"


def test_a_compiled_network_trains_alike(tmp_path):
    plain.task(tmp_path / "plain", steps=5).run()
    task = plain.task(tmp_path / "compiled", steps=5, learning={"compile": "aot_eager"})
    calls = []
    compile_ = task.learning.model.compile
    task.learning.model.compile = lambda **options: (calls.append(options), compile_(**options))
    task.run()
    assert calls == [{"backend": "aot_eager"}]
    first, second = plain.state(tmp_path / "plain"), plain.state(tmp_path / "compiled")
    assert list(first["state_dict"]) == list(second["state_dict"])
    for name, value in first["state_dict"].items():
        torch.testing.assert_close(second["state_dict"][name], value, rtol=1e-5, atol=1e-7)
    assert first["scenefw"]["recipe"] == second["scenefw"]["recipe"]
    average = second["scenefw"]["average"]["values"]
    assert list(first["scenefw"]["average"]["values"]) == list(average)


def test_the_optimiser_steps_in_one_kernel_where_gradients_need_no_scaling(tmp_path):
    task = plain.task(tmp_path, steps=1)
    task.run()
    assert task.learning.trainer.optimizers[0].param_groups[0]["fused"] is True
