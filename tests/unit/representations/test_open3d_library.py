"""Open3D is named with its install line, and brings no warning of numba's."""

import subprocess
import sys

import pytest

from scenefw.core.errors import MissingDependencyError
from scenefw.representations.open3d_library import require_open3d

LOOP = """
import numpy, numba
from scenefw.representations.open3d_library import require_open3d
require_open3d("this test")
@numba.njit(parallel=True)
def total(values):
    found = 0.0
    for i in numba.prange(values.size):
        found += values[i]
    return found
assert total(numpy.ones(9)) == 9
"""


@pytest.mark.exhaustive
def test_its_tbb_is_not_complained_about():
    pytest.importorskip("open3d", exc_type=ImportError)
    done = subprocess.run([sys.executable, "-c", LOOP], capture_output=True, text=True, check=True)
    assert "TBB" not in done.stderr


def test_without_it_the_message_says_what_needs_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(MissingDependencyError, match=r"^odometry needs.*scenefw\[open3d\].*libgl1"):
        require_open3d("odometry")
