import numba
import pytest
import torch

from scenefw.core.cores import Supply
from scenefw.core.errors import ConfigError
from scenefw.execution import threads as module
from scenefw.execution.threads import require_threads, threads


@pytest.fixture
def quota(monkeypatch):
    def give(cores):
        limit = None if cores is None else Supply(cores, lambda: 0.0)
        monkeypatch.setattr(module, "quota", lambda: limit)

    monkeypatch.setattr(module, "environment_decides", lambda: False)
    return give


@pytest.fixture
def four():
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield
    torch.set_num_threads(before)


def test_a_number_of_threads_holds_inside_alone(four):
    most = numba.config.NUMBA_NUM_THREADS
    with threads(3, yields=False):
        assert torch.get_num_threads() == 3
        assert numba.get_num_threads() == min(3, most)
    assert (torch.get_num_threads(), numba.get_num_threads()) == (4, most)


@pytest.mark.parametrize(("cores", "expected"), [(2.9, 2), (0.5, 1), (8, 4), (None, 4)])
def test_threads_are_whole_cores_of_a_quota(four, quota, cores, expected):
    quota(cores)
    with threads(None, yields=False):
        assert torch.get_num_threads() == expected


def test_who_gives_a_number_has_it_whatever_the_quota(four, quota):
    quota(1)
    with threads(2, yields=False):
        assert torch.get_num_threads() == 2


@pytest.mark.parametrize("count", [0, -1, 1.5, "two", True])
def test_a_number_that_is_none_is_one_line(count):
    with pytest.raises(ConfigError, match=f"threads is {count}; expected"):
        require_threads(count)


def test_no_number_is_fine():
    require_threads(None)
    require_threads(1)
