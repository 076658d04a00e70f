"""What `debug=deterministic` and `debug=profile` do to a run, whatever it does."""

from __future__ import annotations

import cProfile
import io
import os
import pstats
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from scenefw.core.files import write_text

PROFILE = "profile"
_LINES = 60  # of each table

Result = TypeVar("Result")


def make_deterministic() -> None:
    """One thread, and an error from operations whose result depends on the order of threads.

    For the rest of the process, so that another run of a sweep has it too.
    """
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # before CUDA starts
    import numba
    import torch

    torch.use_deterministic_algorithms(True)
    numba.set_num_threads(1)  # first: numba's pool, when it starts, gives torch as many threads
    torch.set_num_threads(1)


def profiled(work: Callable[[], Result], folder: Path) -> Result:
    """The result of the work; writes a profile, even if the work fails.

    `profile.txt` lists functions by time with and without what they call, `profile.prof` is for
    pstats and viewers. Work of other processes, and of a GPU beside this one, is not in it.
    """
    profile = cProfile.Profile()
    try:
        return profile.runcall(work)
    finally:
        profile.dump_stats(folder / f"{PROFILE}.prof")
        write_text(folder / f"{PROFILE}.txt", _table(profile))


def _table(profile: cProfile.Profile) -> str:
    text = io.StringIO()
    stats = pstats.Stats(profile, stream=text)
    for order in ("cumulative", "tottime"):
        stats.sort_stats(order).print_stats(_LINES)
    return text.getvalue()
