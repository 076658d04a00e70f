"""Where compiled code lies, and what is said if it can lie nowhere."""

import os
import subprocess
import sys

import pytest

from scenefw.core.errors import StorageError
from scenefw.kernels import compile as compiled


def test_it_lies_in_the_cache_of_the_user(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert compiled._cache_folder().is_relative_to(tmp_path / "scenefw" / "kernels")


def test_if_no_folder_can_be_written_the_variable_is_named(monkeypatch):
    monkeypatch.setattr(compiled, "cache_folder", lambda: None)
    with pytest.raises(StorageError, match="set NUMBA_CACHE_DIR=FOLDER to one that can"):
        compiled._cache_folder()


@pytest.mark.exhaustive
def test_if_the_folder_of_the_variable_can_not_be_written_it_is_named():
    words = [sys.executable, "-c", "import scenefw.kernels.compile"]
    env = {**os.environ, "NUMBA_CACHE_DIR": "/dev/null/x"}
    done = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    error = done.stderr.splitlines()[-1]
    assert error.startswith("scenefw.core.errors.StorageError: ")
    assert "NUMBA_CACHE_DIR=/dev/null/x; give a folder" in error
