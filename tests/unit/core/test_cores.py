import os
import subprocess
import sys
import time

import pytest

from scenefw.core import cores
from scenefw.core.cores import Neighbours, Supply, quota, supplies


class Clock:
    """Seconds of cores that the test says were used."""

    def __init__(self):
        self.used = self.own = self.now = 0.0

    def pass_by(self, seconds, own, others):
        self.now += seconds
        self.own += seconds * own
        self.used += seconds * (own + others)


@pytest.fixture
def clock(monkeypatch):
    made = Clock()
    monkeypatch.setattr(cores.time, "monotonic", lambda: made.now)
    return made


def test_others_crowd_where_they_leave_fewer_cores_than_threads(clock):
    neighbours = Neighbours([Supply(4, lambda: clock.used)], lambda: clock.own)
    for threads, others, crowded in [
        (4, 0.1, False),
        (4, 1.0, True),
        (3, 1.0, False),
        (2, 3, True),
    ]:
        clock.pass_by(0.5, own=threads, others=others)
        assert neighbours.crowd(threads) is crowded


def test_own_work_is_no_crowd_however_much(clock):
    neighbours = Neighbours([Supply(2, lambda: clock.used)], lambda: clock.own)
    clock.pass_by(0.5, own=2, others=0)
    assert not neighbours.crowd(2)


def test_a_quota_counts_beside_free_cores(clock):
    machine, group = Supply(64, lambda: clock.used), Supply(2, lambda: clock.used)
    neighbours = Neighbours([machine, group], lambda: clock.own)
    clock.pass_by(0.5, own=1, others=1)
    assert neighbours.crowd(2)


@pytest.mark.skipif(not supplies(), reason="this system does not tell who uses its cores")
def test_work_of_another_process_is_seen_on_this_machine():
    machine = supplies()[0]
    before, own = machine.busy_seconds(), time.process_time()
    work = "import time\nwhile time.process_time() < 0.5: pass"
    subprocess.run([sys.executable, "-c", work], check=True)
    assert machine.busy_seconds() - before - (time.process_time() - own) > 0.4


def test_only_cores_that_the_process_may_use_are_counted(tmp_path):
    stat = tmp_path / "stat"
    stat.write_text(
        "cpu  40 1 2 900 5 6 7 8 0 0\n"
        "cpu0 10 1 2 400 5 6 7 8 0 0\n"
        "cpu1 30 0 0 500 0 0 0 0 0 0\n"
        "intr 99 1 2\n"
    )
    hertz = os.sysconf("SC_CLK_TCK")
    assert cores._busy(stat, frozenset({"cpu0"})) == pytest.approx(26 / hertz)
    assert cores._busy(stat, frozenset({"cpu0", "cpu1"})) == pytest.approx(56 / hertz)


def test_the_smallest_quota_of_the_groups_above_counts(tmp_path):
    inner = tmp_path / "outer" / "inner"
    inner.mkdir(parents=True)
    (tmp_path / "groups").write_text("0::/outer/inner\n")
    (inner / "cpu.max").write_text("max 100000\n")
    (tmp_path / "outer" / "cpu.max").write_text("150000 100000\n")
    (tmp_path / "outer" / "cpu.stat").write_text("usage_usec 2500000\nuser_usec 1\n")
    found = quota(tmp_path / "groups", tmp_path)
    assert (found.cores, found.busy_seconds()) == (1.5, 2.5)


def test_a_quota_of_control_groups_of_the_first_version(tmp_path):
    (tmp_path / "groups").write_text("4:memory:/x\n3:cpu,cpuacct:/docker/1\n0::/\n")
    for name in ("cpu", "cpuacct"):  # in a container the group's own folder can't be seen
        (tmp_path / name).mkdir()
    (tmp_path / "cpu" / "cpu.cfs_quota_us").write_text("200000\n")
    (tmp_path / "cpu" / "cpu.cfs_period_us").write_text("50000\n")
    (tmp_path / "cpuacct" / "cpuacct.usage").write_text("1500000000\n")
    found = quota(tmp_path / "groups", tmp_path)
    assert (found.cores, found.busy_seconds()) == (4, 1.5)
    (tmp_path / "cpu" / "cpu.cfs_quota_us").write_text("-1\n")
    assert quota(tmp_path / "groups", tmp_path) is None


def test_no_control_groups_are_no_quota(tmp_path):
    assert quota(tmp_path / "missing", tmp_path) is None
