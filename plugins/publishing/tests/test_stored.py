import pytest
from tests.unit.report.stored_runs import IMAGES, write_run

from scenefw.core.errors import InputError
from scenefw_publishing.stored import read_runs


def test_a_folder_and_the_file_in_it_are_the_same_run(tmp_path):
    folder = write_run(tmp_path / "run", IMAGES, command=("experiment=osd", "input=/home/me/x"))
    first, second = read_runs([folder, folder / "metrics.json"])
    assert first == second
    assert first.figures == IMAGES
    assert first.origin == ("python -m scenefw experiment=osd input=x  # commit 0123456789, seed 7")


@pytest.mark.parametrize("text", ["{", "[1, 2]", '{"a": "b"}'])
def test_what_holds_no_figures(tmp_path, text):
    (tmp_path / "metrics.json").write_text(text)
    with pytest.raises(InputError, match=r"metrics\.json"):
        read_runs([tmp_path])


def test_nothing_there(tmp_path):
    with pytest.raises(InputError, match="no figures at"):
        read_runs([tmp_path])
