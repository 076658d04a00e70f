"""Where files go that can be made again, on machines where the usual folder can't be written."""

import os
import tempfile
from pathlib import Path

import pytest

from scenefw.core import cache_folder as module
from scenefw.core.cache_folder import cache_folder, is_writable, share_with_matplotlib


@pytest.fixture
def machine(monkeypatch, tmp_path):
    """A machine with a home and a folder for temporary files, and nothing set."""
    for name in ("home", "tmp", "work"):
        (tmp_path / name).mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for variable in ("XDG_CACHE_HOME", "MPLCONFIGDIR"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))
    monkeypatch.chdir(tmp_path / "work")
    return tmp_path


@pytest.fixture
def no_home(machine, monkeypatch):
    """The same without a home, as for a user that no list of users has."""

    def home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", home)
    return machine


def test_the_usual_folder_is_that_of_the_home(machine):
    assert cache_folder() == machine / "home" / ".cache"


def test_a_folder_of_ones_own_choice_comes_first(machine, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(machine / "mine"))
    assert cache_folder() == machine / "mine"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")  # not allowed by the XDG specification
    assert cache_folder() == machine / "home" / ".cache"


def test_without_a_home_it_is_private_and_temporary(no_home):
    folder = cache_folder()
    assert folder.parent == no_home / "tmp"
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_home_that_is_no_folder_is_like_none(machine, monkeypatch):
    (machine / "file").write_text("")
    monkeypatch.setenv("HOME", str(machine / "file"))
    assert cache_folder().parent == machine / "tmp"


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="POSIX permissions")
def test_a_temporary_folder_that_others_can_write_is_not_taken(no_home):
    cache_folder().chmod(0o777)
    assert cache_folder() is None


def test_a_link_that_somebody_has_laid_is_not_taken(no_home):
    folder = cache_folder()
    folder.rmdir()
    (no_home / "elsewhere").mkdir(mode=0o700)
    folder.symlink_to(no_home / "elsewhere")
    assert cache_folder() is None


def test_the_current_folder_is_no_cache(no_home, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(no_home / "work"))  # what is left for tempfile
    assert cache_folder() is None
    assert not list((no_home / "work").iterdir())


def test_a_read_only_file_system_has_none(machine, monkeypatch):
    def mkdir(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "mkdir", mkdir)
    assert not is_writable(machine / "home")
    assert cache_folder() is None


def test_matplotlib_writes_there_only_if_it_can_not_write_home(machine, monkeypatch):
    share_with_matplotlib()
    assert "MPLCONFIGDIR" not in os.environ
    monkeypatch.setattr(module, "is_writable", lambda folder: machine / "tmp" in folder.parents)
    share_with_matplotlib()
    assert Path(os.environ["MPLCONFIGDIR"]).parent == cache_folder()
