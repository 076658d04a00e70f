"""Where compiled code lies, and what is said if it can lie nowhere."""

import os
import subprocess
import sys

import pytest

IMPORT = "import scenefw.kernels.compile as c, numba; print(numba.config.CACHE_DIR)"
NOWHERE = (
    "from scenefw.core import cache_folder; cache_folder.is_writable = lambda folder: False;"
    f"{IMPORT}"
)


def run(code, **env):
    cleared = {k: v for k, v in os.environ.items() if k not in ("NUMBA_CACHE_DIR", *env)}
    words = [sys.executable, "-c", code]
    return subprocess.run(words, env={**cleared, **env}, capture_output=True, text=True)


def test_it_lies_in_the_cache_of_the_user(tmp_path):
    done = run(IMPORT, XDG_CACHE_HOME=str(tmp_path))
    assert done.stdout.startswith(str(tmp_path / "scenefw" / "kernels")), done.stderr


@pytest.mark.parametrize(
    ("code", "env", "words"),
    [
        (NOWHERE, {}, "set NUMBA_CACHE_DIR=FOLDER to one that can"),
        (IMPORT, {"NUMBA_CACHE_DIR": "/dev/null/x"}, "NUMBA_CACHE_DIR=/dev/null/x; give a folder"),
    ],
)
def test_if_it_can_not_be_written_the_variable_is_named(code, env, words):
    done = run(code, **env)
    assert done.returncode == 1
    error = done.stderr.splitlines()[-1]
    assert error.startswith("scenefw.core.errors.StorageError: ")
    assert words in error
