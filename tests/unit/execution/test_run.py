import pytest

from scenefw.core.errors import ConfigError
from scenefw.execution.run import claim, require_seed


def test_runs_of_the_same_second_have_folders_of_their_own(tmp_path):
    wanted = tmp_path / "12-30-00"
    wanted.mkdir()
    folders = [claim(wanted) for _ in range(3)]
    assert [folder.name for folder in folders] == ["12-30-00", "12-30-00-2", "12-30-00-3"]
    assert all((folder / "run.json").is_file() for folder in folders)


@pytest.mark.parametrize("seed", [-1, 1.5, "abc", None, True])
def test_a_seed_that_is_no_whole_number_is_one_line(seed):
    with pytest.raises(ConfigError, match=f"seed is {seed}; expected"):
        require_seed(seed)


def test_a_seed_may_be_large():
    require_seed(0)
    require_seed(2**62)
