"""How many cores other programs use."""

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

_STAT = Path("/proc/stat")
_GROUPS = Path("/proc/self/cgroup")
_MOUNT = Path("/sys/fs/cgroup")
_SLACK = 0.25
"""Cores of other programs that don't matter: the system's own work, and the rounding of clocks."""


@dataclass(frozen=True)
class Supply:
    """Cores that programs share.

    Args:
        cores: how many.
        busy_seconds: seconds of them that all programs have used so far.
    """

    cores: float
    busy_seconds: Callable[[], float]


class Neighbours:
    """Says whether other programs need the cores that this process would use.

    Args:
        supplies: what the process may not exceed, and shares.
        process_seconds: seconds of cores that this process has used so far.
    """

    def __init__(
        self, supplies: list[Supply], process_seconds: Callable[[], float] = time.process_time
    ) -> None:
        self._supplies, self._process_seconds = supplies, process_seconds
        self._before = self._now()

    def crowd(self, threads: int) -> bool:
        """Whether other programs have left fewer than `threads` cores since the last call."""
        before, self._before = self._before, self._now()
        elapsed, process_seconds, *busy_seconds = (
            now - then for now, then in zip(self._before, before, strict=True)
        )
        return any(
            (seconds - process_seconds) / elapsed + threads > supply.cores + _SLACK
            for seconds, supply in zip(busy_seconds, self._supplies, strict=True)
        )

    def _now(self) -> list[float]:
        return [
            time.monotonic(),
            self._process_seconds(),
            *(supply.busy_seconds() for supply in self._supplies),
        ]


def supplies() -> list[Supply]:
    """The cores this process may run on and, if it has one, the quota of its control group.

    Empty where the system does not tell (anything but Linux).
    """
    if not hasattr(os, "sched_getaffinity") or not _STAT.exists():
        return []
    allowed = frozenset(f"cpu{n}" for n in os.sched_getaffinity(0))
    machine = Supply(len(allowed), partial(_busy, _STAT, allowed))
    group = quota()
    return [machine] if group is None else [machine, group]


def quota(groups: Path = _GROUPS, mount: Path = _MOUNT) -> Supply | None:
    """The smallest quota of the control groups that this process is in; None without one.

    Args:
        groups: lines `number:controllers:path`, as /proc/self/cgroup has.
        mount: where control groups lie.
    """
    quotas = [*_second_version(groups, mount), *_first_version(groups, mount)]
    return min(quotas, key=lambda supply: supply.cores, default=None)


def _busy(stat: Path, allowed: frozenset[str]) -> float:
    """Seconds that some cores have spent on programs and the system."""
    lines = (line.split() for line in stat.read_text().splitlines() if line.startswith("cpu"))
    ticks = 0
    for name, user, nice, system, _idle, _wait, interrupts, soft, *_ in lines:
        if name in allowed:
            ticks += sum(map(int, (user, nice, system, interrupts, soft)))
    return ticks / os.sysconf("SC_CLK_TCK")


def _second_version(groups: Path, mount: Path) -> Iterator[Supply]:
    for folder in _folders(groups, mount, ""):
        words = _read(folder / "cpu.max").split()
        if len(words) == 2 and words[0] != "max":
            yield Supply(int(words[0]) / int(words[1]), partial(_microseconds, folder))


def _first_version(groups: Path, mount: Path) -> Iterator[Supply]:
    for folder in _folders(groups, mount / "cpu", "cpu"):
        limit, period = (_read(folder / f"cpu.cfs_{n}_us") for n in ("quota", "period"))
        usage = mount / "cpuacct" / folder.relative_to(mount / "cpu") / "cpuacct.usage"
        if limit and period and int(limit) > 0 and usage.exists():
            yield Supply(int(limit) / int(period), partial(_nanoseconds, usage))


def _folders(groups: Path, mount: Path, controller: str) -> Iterator[Path]:
    """The folder of this process's group and those above it, as far as they can be seen."""
    for line in _read(groups).splitlines():
        _, names, path = line.split(":", 2)
        if controller in names.split(","):
            inner = Path(path.lstrip("/"))
            yield from (mount / part for part in (inner, *inner.parents))


def _nanoseconds(usage: Path) -> float:
    return int(_read(usage) or 0) / 1e9


def _microseconds(folder: Path) -> float:
    words = _read(folder / "cpu.stat").split()
    return int(words[words.index("usage_usec") + 1]) / 1e6 if "usage_usec" in words else 0.0


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:  # another version of control groups, or none
        return ""
