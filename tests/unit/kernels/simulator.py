"""`results()` of a test module by numba's CUDA simulator: MODULE FILE, in a process of its own."""

import importlib
import sys

import numpy as np

if __name__ == "__main__":
    from scenefw.kernels.compile import Kernel

    Kernel.__call__ = Kernel.simulate
    np.savez(sys.argv[2], **importlib.import_module(sys.argv[1]).results())
