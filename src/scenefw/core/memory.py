"""How much memory a process may still take."""

import os
from collections.abc import Iterator
from pathlib import Path

# Limit, use and the name of what the kernel can reclaim of it (files that it keeps for later), for
# control groups of version 2 and 1
_GROUPS = (
    ("sys/fs/cgroup", "memory.max", "memory.current", "inactive_file"),
    (
        "sys/fs/cgroup/memory",
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        "total_inactive_file",
    ),
)


def available_memory(root: Path | str = "/") -> int | None:
    """Bytes free on this machine and in every control group of this process.

    Containers and batch systems limit groups; the kernel ends a process that takes more. None
    where it can't be found out (not on Linux).

    Args:
        root: of the file system.
    """
    amounts = [_machine(Path(root)), *_groups(Path(root))]
    return min((free for free in amounts if free is not None), default=None)


def _machine(root: Path) -> int | None:
    for line in _text(root / "proc/meminfo").splitlines():
        name, _, value = line.partition(":")
        if name == "MemAvailable":
            return int(value.split()[0]) * 1024
    return None


def _groups(root: Path) -> Iterator[int]:
    """What is left in the groups of this process, and in those around them."""
    for line in _text(root / "proc/self/cgroup").splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        mount, limit, use, given_back = _GROUPS[1 if controllers else 0]
        group = Path(os.path.normpath("/" + path.lstrip("/")))
        for part in (group, *group.parents):
            folder = root / mount / part.relative_to("/")
            numbers = _text(folder / limit).strip(), _text(folder / use).strip()
            if all(number.isdigit() for number in numbers):  # not "max", and there
                files = _entry(folder / "memory.stat", given_back)
                yield max(int(numbers[0]) - int(numbers[1]) + files, 0)


def _entry(path: Path, name: str) -> int:
    values = dict(line.split(maxsplit=1) for line in _text(path).splitlines() if " " in line)
    return int(values.get(name, 0))


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="ascii", errors="replace")
    except OSError:  # not there on this system, or not for us
        return ""
