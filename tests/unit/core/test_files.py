import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.files import (
    append_text,
    in_order,
    keeping,
    replacing,
    require_apart,
    require_free,
    require_name,
    require_writable,
    unreadable,
    utf8_text,
    write_text,
)


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


@pytest.mark.parametrize("mask", [0o022, 0o027, 0o077])
def test_a_new_file_has_the_mode_of_any_new_file(tmp_path, mask):
    before = os.umask(mask)
    try:
        (tmp_path / "plain").write_text("")
        write_text(tmp_path / "file", "text")
    finally:
        os.umask(before)
    assert mode_of(tmp_path / "file") == mode_of(tmp_path / "plain") == 0o666 & ~mask


def test_the_mask_of_other_threads_is_left_alone(tmp_path, monkeypatch):
    """The process has one; while a thread sets it, another's new files are open to all."""
    masks = []
    monkeypatch.setattr(os, "umask", lambda mask: masks.append(mask) or 0o022)
    write_text(tmp_path / "file", "text")
    write_text(tmp_path / "file", "text")
    assert masks == []


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o666, 0o755])
def test_a_file_keeps_its_mode(tmp_path, mode):
    target = tmp_path / "file"
    target.write_text("old")
    target.chmod(mode)
    with replacing(target) as temporary:
        assert mode_of(temporary) & ~mode & 0o077 == 0  # nobody else reads it meanwhile
        temporary.write_text("new")
    assert target.read_text() == "new"
    assert mode_of(target) == mode


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_the_file_that_it_names_is_replaced(tmp_path, there):
    (tmp_path / "far").mkdir()
    real = tmp_path / "far" / "real"
    if there:
        real.write_text("old")
    (tmp_path / "middle.png").symlink_to(real)
    link = tmp_path / "link.txt"
    link.symlink_to("middle.png")
    with replacing(link) as temporary:
        assert temporary.suffix == ".txt"
        assert temporary.parent == real.parent  # else it could be on another disk
        temporary.write_text("new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    assert not real.is_symlink()
    assert [p.name for p in real.parent.iterdir()] == ["real"]
    assert sorted(p.name for p in tmp_path.iterdir()) == ["far", "link.txt", "middle.png"]


def test_no_folder_is_made_where_a_link_leads_nowhere(tmp_path):
    """As of a disk that is not mounted."""
    (tmp_path / "link").symlink_to(tmp_path / "disk" / "file")
    with pytest.raises(StorageError, match="link: No such file"):
        write_text(tmp_path / "link", "text")
    assert [p.name for p in tmp_path.iterdir()] == ["link"]


def test_what_is_no_file_is_left_alone(tmp_path):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "circle").symlink_to("circle")
    for name, why in (("folder", "a folder"), ("pipe", "no plain"), ("circle", "no plain")):
        with pytest.raises(StorageError, match=f"{name}: it is {why}"):
            write_text(tmp_path / name, "text")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["circle", "folder", "pipe"]
    assert stat.S_ISFIFO((tmp_path / "pipe").stat().st_mode)


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


def test_a_full_disk_leaves_the_old_file_alone(tmp_path, full_disk):
    target = tmp_path / "file.txt"
    write_text(target, "old")
    with full_disk(1000), pytest.raises(StorageError, match=r"file\.txt: File too large; choose"):
        write_text(target, 2000 * "n")
    assert target.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


def test_text_is_added_whole_or_not_at_all(tmp_path, full_disk):
    target = tmp_path / "rows.csv"
    append_text(target, "a,1\n")
    append_text(target, "\u00e4,2\r\n")
    before = target.read_bytes()
    assert before == b"a,1\n\xc3\xa4,2\r\n"
    with full_disk(1000), pytest.raises(StorageError, match=r"rows\.csv: File too large"):
        append_text(target, 2000 * "n")  # the first 990 bytes still fit
    assert target.read_bytes() == before
    with pytest.raises(StorageError, match="none"):
        append_text(tmp_path / "none" / "rows.csv", "a")


@pytest.mark.parametrize("name", ["", ".", "..", "../x", "/x", "a/b", "a\\b", "a\0", 250 * "a"])
def test_a_name_is_no_path(name):
    with pytest.raises(ConfigError, match=r"^run\.name is .*expected a plain file name"):
        require_name(name, "run.name")


@pytest.mark.parametrize("name", ["simstack", "a.b", "...", "Tür 3", "-1"])
def test_a_plain_name_comes_back(name):
    assert require_name(name, "run.name") == name


def test_results_do_not_go_among_the_images(tmp_path):
    (tmp_path / "in" / "depth").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "in")
    for output in ("in", "in/depth", "in/../in", "link", "link/depth"):
        with pytest.raises(ConfigError, match=r"is the folder of the input.*in/results$"):
            require_apart(tmp_path / output, tmp_path / "in")
    for output in ("in/results", "out", "."):
        require_apart(tmp_path / output, tmp_path / "in")
    (tmp_path / "image.png").touch()
    require_apart(tmp_path, tmp_path / "image.png")  # a folder for this image is made beside it


def test_a_missing_file_is_said_in_words(tmp_path):
    with pytest.raises(FileNotFoundError) as error:
        (tmp_path / "none.png").read_bytes()
    assert unreadable(error.value) == "no such file or directory"


def test_files_of_somebody_else_are_kept_within_a_block(tmp_path):
    mine, link = tmp_path / "mine.txt", tmp_path / "link.txt"
    mine.write_text("mine")
    link.symlink_to(mine)
    with keeping([mine]):
        for path in (mine, link):
            with pytest.raises(StorageError, match=rf"{path.name} is not of a run .* move it away"):
                write_text(path, "ours")
            with pytest.raises(StorageError, match="would be lost"):
                require_free(path)
        write_text(tmp_path / "other.txt", "ours")
        require_free(tmp_path / "other.txt")
    assert mine.read_text() == "mine"
    write_text(mine, "ours")


def test_the_line_that_is_not_utf8_is_told(tmp_path):
    (tmp_path / "a.txt").write_bytes(b"\xef\xbb\xbfone\ntwo\n")
    assert utf8_text(tmp_path / "a.txt") == "one\ntwo\n"
    (tmp_path / "b.txt").write_bytes("one\nzwölf\n".encode("latin-1"))
    with pytest.raises(ValueError, match="line 2 is not UTF-8; save it as UTF-8"):
        utf8_text(tmp_path / "b.txt")
