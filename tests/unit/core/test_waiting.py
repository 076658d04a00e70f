"""A process of its own for each test, in which torch was loaded without OpenMP's variables."""

import os
import sys

import pytest
from tests.warm import Warm

from scenefw.core.waiting import _VARIABLES, environment_decides

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or len(os.sched_getaffinity(0)) < 2,
    reason="libgomp's threads wait for each other on two cores of a Linux system",
)

_BEGIN = """
import os, time
import torch
from scenefw.core import waiting

def compute():
    return torch.ones(2**17).add_(1.0)

def asleep():  # seconds of cores used while there is nothing to do
    began = time.process_time()
    for _ in range(20):
        compute()
        time.sleep(0.01)
    return time.process_time() - began

def count():
    return len(os.listdir("/proc/self/task"))

torch.set_num_threads(2)
compute()
"""


@pytest.fixture(scope="module")
def process():
    found = Warm(("torch",), dict.fromkeys(_VARIABLES))
    yield found
    found.stop()


@pytest.fixture
def run(process, tmp_path):
    def run(script, **variables):
        (tmp_path / "script.py").write_text(_BEGIN + script)
        environment = {k: v for k, v in os.environ.items() if k not in _VARIABLES} | variables
        done = process.run("script", [], tmp_path, environment)
        assert done.returncode == 0, done.stderr

    return run


def test_threads_wait_asleep_while_there_are_sleepers_and_busily_without(run):
    run("""
sleepers = waiting.Sleepers()
busy = asleep()
sleepers.add()
idle = asleep()
sleepers.remove()
again = asleep()
assert idle < 0.5 * busy and idle < 0.5 * again, (busy, idle, again)
""")


def test_sleepers_end_with_their_owner(run):
    run("""
before, sleepers = count(), waiting.Sleepers()
sleepers.add()
sleepers.add()  # those that are there are kept
added = count() - before
sleepers.remove()
assert added == len(waiting.pools()) * (len(os.sched_getaffinity(0)) + 1), added
for _ in range(500):
    if count() == before:
        break
    time.sleep(0.01)
assert count() == before
""")


def test_a_pool_that_is_loaded_later_gets_sleepers_too(run):
    run("""
sleepers = waiting.Sleepers()
sleepers.add()
before = waiting.pools()
import numba
numba.get_num_threads()  # starts its pool
sleepers.add()
assert set(sleepers._groups) == set(waiting.pools()) > set(before)
""")


def test_results_are_the_same_bits_with_sleepers_and_without(run):
    run("""
def work():
    torch.manual_seed(0)
    layer, x = torch.nn.Conv3d(8, 16, 3), torch.randn(8, 8, 24, 24, 24)
    layer(x).square().sum().backward()
    return torch.cat([layer.weight.grad.flatten(), x.square().sum()[None]])
alone, sleepers = work(), waiting.Sleepers()
sleepers.add()
assert torch.equal(work(), alone)
torch.set_num_threads(3)
assert not torch.equal(work(), alone)  # so the number of threads is left alone
""")


_CROWDED = """
from scenefw.core.cores import Supply
waiting._INTERVAL = 0.01
waiting.supplies = lambda: [Supply(2, lambda: 9 * time.monotonic())]  # others use nine cores
before, most = count(), 0
with waiting.yielding(lambda: {threads}, enabled={wanted}):
    end = time.monotonic() + {patience}
    while time.monotonic() < end and most < before + 2:
        most = max(most, count())
        time.sleep(0.01)
assert {expected}, (before, most)
"""


def test_others_put_waiting_threads_to_sleep(run):
    run(_CROWDED.format(threads=2, wanted=True, patience=60, expected="most >= before + 2"))


@pytest.mark.parametrize(("threads", "wanted"), [(1, True), (2, False)])
def test_one_thread_or_a_setting_leaves_all_alone(run, threads, wanted):
    # the watching thread itself is one
    script = _CROWDED.format(
        threads=threads, wanted=wanted, patience=0.5, expected="most <= before + 1"
    )
    run(script)


@pytest.mark.parametrize("variable", _VARIABLES)
def test_variables_of_openmp_leave_all_alone(run, variable, monkeypatch):
    for name in _VARIABLES:
        monkeypatch.delenv(name, raising=False)
    assert not environment_decides()
    value = {"OMP_WAIT_POLICY": "ACTIVE"}.get(variable, "2")
    script = _CROWDED.format(threads=2, wanted=True, patience=0.5, expected="most == before")
    run(script, **{variable: value})
