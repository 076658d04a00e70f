"""Files as Linux has them, of version 2 and 1 of control groups."""

import sys

import pytest

from scenefw.core.memory import available_memory

GB = 1 << 30


def machine(root, groups, free=20 * GB):
    files = {"proc/meminfo": f"MemTotal: 99 kB\nMemAvailable:   {free // 1024} kB\n", **groups}
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(str(text))
    return available_memory(root)


def v2(path, limit, use, files=0):
    folder = f"sys/fs/cgroup{path}"
    return {
        f"{folder}/memory.max": f"{limit}\n",
        f"{folder}/memory.current": f"{use}\n",
        f"{folder}/memory.stat": f"anon 5\ninactive_file {files}\nactive_file 7\n",
    }


def test_a_machine_without_groups(tmp_path):
    assert machine(tmp_path, {}) == 20 * GB
    assert available_memory(tmp_path / "none") is None


def test_the_closest_limit_counts(tmp_path):
    own = {"proc/self/cgroup": "0::/batch/job_7\n", **v2("/batch/job_7", "max", 2 * GB)}
    assert machine(tmp_path, own) == 20 * GB
    around = {**own, **v2("/batch", 8 * GB, 5 * GB, files=GB)}
    assert machine(tmp_path, around) == 4 * GB  # files are given back
    assert machine(tmp_path, around, free=GB) == GB
    assert machine(tmp_path, {**around, **v2("/batch/job_7", 2 * GB, 3 * GB)}) == 0


def test_a_container_sees_its_own_group_as_the_root(tmp_path):
    inside = {"proc/self/cgroup": "0::/docker/0123abc\n", **v2("", 3 * GB, GB)}
    assert machine(tmp_path, inside) == 2 * GB
    outside = {"proc/self/cgroup": "0::/../../else\n", **v2("", 3 * GB, GB)}
    assert machine(tmp_path, outside) == 2 * GB


def test_version_1(tmp_path):
    folder = "sys/fs/cgroup/memory/slurm"
    groups = {
        "proc/self/cgroup": "9:cpu,cpuacct:/other\n4:memory:/slurm/step\n0::/\n",
        f"{folder}/memory.limit_in_bytes": 4 * GB,
        f"{folder}/memory.usage_in_bytes": 3 * GB,
        f"{folder}/memory.stat": f"inactive_file 0\ntotal_inactive_file {GB}\n",
    }
    assert machine(tmp_path, groups) == 2 * GB


@pytest.mark.skipif(sys.platform != "linux", reason="not Linux")
def test_this_machine():
    assert 1 << 20 < available_memory() < 1 << 50
