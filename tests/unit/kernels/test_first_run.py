"""A run that compiles gives the same bits as one that reads compiled code back."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import hashlib, torch
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective

view = Camera(40, 30, 35.0, 35.0, 19.5, 14.5, look_at((0.8, 0.3, 0.5), (0.0, 0.0, 0.1)))
depth = 0.8 + 0.4 * torch.rand(1, 30, 40, generator=torch.Generator().manual_seed(0))
distance = Projective().fuse(depth, GridSpec(16), stack_cameras([view])).distance
print(hashlib.sha256(distance.numpy().tobytes()).hexdigest())
"""


@pytest.mark.exhaustive
def test_the_first_run_equals_the_second(tmp_path):
    cache = tmp_path / "cache"
    results = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "NUMBA_CACHE_DIR": str(cache)},
            capture_output=True,
            text=True,
            check=True,
        )
        results.append(done.stdout.strip())
        assert list(cache.rglob("*.nbc")), "nothing was cached"
    assert results[0] == results[1]
