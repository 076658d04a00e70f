"""Processes of this machine: same results as a loop, and a killed one is said."""

import pytest
from plugins.sweeps.tests.work import doomed, square

from scenefw.core.errors import ConfigError, WorkerError
from scenefw_sweeps.local import Local


@pytest.mark.parametrize("workers", [1, 2])
def test_results_are_those_of_a_loop(workers):
    numbers = list(range(7))
    expected = [n * n for n in numbers]
    assert list(Local(workers).each(square, numbers)) == expected
    assert sorted(Local(workers).each(square, numbers, ordered=False)) == expected
    assert list(Local(workers).each(square, [])) == []


def test_results_come_one_by_one():
    seen = []
    results = Local(1).each(lambda n: seen.append(n) or n, [1, 2, 3])
    assert next(results) == 1
    assert seen == [1]


def test_a_killed_process_is_said():
    with pytest.raises(WorkerError, match="killed"):
        list(Local(2).each(doomed, [1, 2, 3]))


def test_no_process():
    with pytest.raises(ConfigError, match=r"parallel\.workers = 0"):
        Local(0)
