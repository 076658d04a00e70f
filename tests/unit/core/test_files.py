import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import StorageError
from scenefw.core.files import in_order, replacing, require_writable, write_text


def test_a_block_that_ends_well_replaces_the_file(tmp_path):
    target = tmp_path / "deep" / "file.txt"
    write_text(target, "old")
    with replacing(target) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
        assert target.read_text() == "old"
    assert target.read_text() == "new"
    assert [p.name for p in target.parent.iterdir()] == ["file.txt"]


def write_half(path):
    path.write_text("half")
    raise ZeroDivisionError


def test_a_block_that_fails_leaves_the_old_file_alone(tmp_path):
    target = tmp_path / "file.txt"
    write_text(target, "old")
    with pytest.raises(ZeroDivisionError), replacing(target) as temporary:
        write_half(temporary)
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


def test_others_may_read_what_was_written(tmp_path):
    plain = tmp_path / "plain"
    plain.write_text("")
    write_text(tmp_path / "file", "text")
    assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == stat.S_IMODE(plain.stat().st_mode)


def test_an_impossible_folder_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match=r"paths\.output"):
        write_text(tmp_path / "file" / "below", "text")
    with pytest.raises(StorageError, match="file"):
        require_writable(tmp_path / "file" / "below")


def test_a_writable_folder_is_left_empty(tmp_path):
    assert require_writable(tmp_path / "new") == tmp_path / "new"
    assert list((tmp_path / "new").iterdir()) == []


@pytest.mark.parametrize(
    "names",
    [
        ["1.png", "2.png", "10.png", "a.png"],
        ["view9_left.png", "view10_left.png", "view10_right.png"],
        ["2/10.png", "10/2.png"],
        ["depth1305031102.175304.png", "depth1305031102.5.png", "depth1305031103.25.png"],
        ["1.25.npy", "1.5.npy", "10.1.npy"],
    ],
)
def test_numbers_in_names_count_as_numbers(names):
    paths = [Path(name) for name in names]
    assert in_order(paths[::-1]) == paths


@given(st.lists(st.tuples(st.text("ab-_. Z", max_size=3), st.integers(0, 999)), unique=True))
def test_padded_numbers_keep_the_order_of_text(parts):
    names = [Path(f"{text}{number:03}{text}.png") for text, number in parts]
    assert in_order(names) == sorted(names)
