"""Silence for libraries that print when they are imported."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def silenced() -> Iterator[None]:
    """Within the block, what is written to standard error is lost, also by compiled code.

    Python's own errors pass. It holds for all threads, so the block should be short.
    """
    sys.stderr.flush()
    stderr_copy = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
        sys.stderr.flush()
    finally:
        os.dup2(stderr_copy, 2)
        os.close(stderr_copy)
