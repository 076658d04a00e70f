import os
import pstats

import numba
import pytest
import torch

from scenefw.execution.modifiers import make_deterministic, profiled


def slow_part():
    return sum(range(1000))


def test_a_profile_names_functions_and_the_result_comes_back(tmp_path):
    assert profiled(slow_part, tmp_path) == sum(range(1000))
    assert "slow_part" in (tmp_path / "profile.txt").read_text()
    stats = pstats.Stats(str(tmp_path / "profile.prof"))
    assert any(name == "slow_part" for _, _, name in stats.stats)


def test_a_profile_of_failed_work_is_written_too(tmp_path):
    def fail():
        slow_part()
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        profiled(fail, tmp_path)
    assert "slow_part" in (tmp_path / "profile.txt").read_text()


@pytest.fixture
def _threads():
    before = torch.get_num_threads(), numba.get_num_threads()
    yield
    torch.use_deterministic_algorithms(False)
    torch.set_num_threads(before[0])
    numba.set_num_threads(before[1])


@pytest.mark.usefixtures("_threads")
def test_one_thread_and_no_operation_that_depends_on_their_order():
    torch.set_num_threads(2)
    make_deterministic()
    assert torch.are_deterministic_algorithms_enabled()
    assert (torch.get_num_threads(), numba.get_num_threads()) == (1, 1)


def test_one_thread_also_where_no_loop_of_numba_has_run_before(warm, tmp_path):
    script = (
        "import torch\n"
        "from scenefw.execution.modifiers import make_deterministic\n"
        "torch.set_num_threads(2)\n"
        "make_deterministic()\n"
        "print(torch.get_num_threads())"
    )
    (tmp_path / "script.py").write_text(script)
    done = warm("script", [], tmp_path, dict(os.environ))
    assert done.stdout.split() == ["1"], done.stderr
