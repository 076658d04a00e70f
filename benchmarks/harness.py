"""Times jobs beside their peers in one run: warm-up first, then turn by turn, medians.

To add jobs, write `benchmarks/<area>.py` with a list `JOBS`; nothing else is edited:

    from benchmarks.harness import Job

    def ours():
        tsdf, camera = ...                        # setup, not timed
        return lambda: trace(tsdf, camera)        # timed

    def open3d():
        import open3d as o3d                      # not installed: a row that says so
        scene = ...
        return lambda: scene.cast_rays(rays)

    JOBS = [Job("depth 640 x 480 of a 64^3 TSDF", ours, {"open3d ray casting": open3d})]

Work on another device must be waited for inside the timed function. A peer that can't do the job
here raises `Unavailable` with the reason.
"""

import statistics
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

from scenefw.core.errors import SceneFWError

Timed = Callable[[], object]
Setup = Callable[[], Timed]
Row = dict[str, str | float | None]


class Unavailable(SceneFWError):  # noqa: N818 - a fact about the peer, not a fault
    """A peer can't do the job on this machine; the message is the reason."""


@dataclass(frozen=True)
class Job:
    """One thing that scenefw does, and others do too.

    Args:
        name: what is done, sizes included.
        ours: prepares inputs and returns the function to time.
        peers: the same of other libraries by name.
        repeats: timed calls of each, fewer for what is slow.
        seconds: time to spend on each of ours and the peers.
    """

    name: str
    ours: Setup
    peers: Mapping[str, Setup] = field(default_factory=dict)
    repeats: int = 15
    seconds: float = 10.0


def measure(job: Job) -> list[Row]:
    """Rows {"job", "ours_ms", "peer", "peer_ms", "ratio"}, one per peer; ratio = peer / ours.

    A peer that can't run has no time and a "note" instead; a job without peers has one row.
    """
    ready = {"": job.ours()}
    notes: dict[str, str] = {}
    for peer, setup in job.peers.items():
        try:
            ready[peer] = setup()
        except (ImportError, OSError, Unavailable) as reason:
            notes[peer] = f"not measured: {reason}"
    times = _medians(ready, job)
    rows = [_row(job.name, times[""], peer, times.get(peer), notes.get(peer)) for peer in job.peers]
    return rows or [_row(job.name, times[""], None, None, None)]


def measure_all(jobs: Iterable[Job], report: Callable[[str], None] = lambda _: None) -> list[Row]:
    """Rows of all jobs; `report` is told the name of each job before it runs."""
    rows: list[Row] = []
    for job in jobs:
        report(job.name)
        rows.extend(measure(job))
    return rows


def _medians(ready: Mapping[str, Timed], job: Job) -> dict[str, float]:
    """Milliseconds by name; taking turns lets a busy machine slow all alike."""
    left = {name: _repeats(function, job) for name, function in ready.items()}
    times: dict[str, list[float]] = {name: [] for name in ready}
    while any(left.values()):
        for name, function in ready.items():
            if left[name]:
                times[name].append(_time(function))
                left[name] -= 1
    return {name: statistics.median(values) for name, values in times.items()}


def _repeats(function: Timed, job: Job) -> int:
    """Warms up, then says how often `function` may run in the job's time."""
    spent = _time(function)
    if spent < job.seconds * 1e3:  # the first call may have compiled something
        spent = _time(function)
    return max(1, min(job.repeats, int(job.seconds * 1e3 / spent)))


def _time(function: Timed) -> float:
    start = time.perf_counter()
    function()
    return max((time.perf_counter() - start) * 1e3, 1e-6)


def _row(job: str, ours: float, peer: str | None, theirs: float | None, note: str | None) -> Row:
    row: Row = {
        "job": job,
        "ours_ms": round(ours, 4),
        "peer": peer,
        "peer_ms": None if theirs is None else round(theirs, 4),
        "ratio": None if theirs is None else round(theirs / ours, 3),
    }
    return row if note is None else {**row, "note": note}
