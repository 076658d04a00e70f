"""Results of a test module computed by numba's CUDA simulator, in a process of its own."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[3]


def simulate(module, file):
    """Arrays by name that `results()` of a module returns there; `file` is written on the way."""
    program = (
        "import sys, numpy\n"
        "from scenefw.kernels.compile import Kernel\n"
        "Kernel.__call__ = Kernel.simulate\n"
        f"from {module} import results\n"
        "numpy.savez(sys.argv[1], **results())\n"
    )
    subprocess.run(
        [sys.executable, "-c", program, os.fspath(file)],
        cwd=ROOT,
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"},
        check=True,
        timeout=300,
    )
    with np.load(file) as stored:
        return dict(stored)
