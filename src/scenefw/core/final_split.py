"""The final split: data that nobody tunes on, read by releases alone, each evaluation counted.

A data set that has a final part calls `look` before it reads it. That works only inside `opened`,
which `run=evaluate split=final` enters. What was read goes into the ledger, a file of the project.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from scenefw.core.errors import ConfigError, StorageError
from scenefw.core.files import append_text

FINAL = "final"
_looks: ContextVar[dict[str, str] | None] = ContextVar("looks", default=None)


@contextmanager
def opened() -> Iterator[Mapping[str, str]]:
    """Lets data sets read their final parts; yields those read, SHA-256 by name."""
    digests: dict[str, str] = {}
    token = _looks.set(digests)
    try:
        yield digests
    finally:
        _looks.reset(token)


def look(name: str, digest: str) -> None:
    """Notes that a final part is about to be read.

    Args:
        name: of the data set.
        digest: SHA-256 of what is in it, or of all that it is made from.

    Raises:
        ConfigError: the final split is not open.
    """
    digests = _looks.get()
    if digests is None:
        raise ConfigError(
            f"the final split of {name} is for releases; evaluate it with "
            "run=evaluate split=final report.publish=FILE, which counts it, or take split=test"
        )
    digests[name] = digest


def looks() -> Mapping[str, str]:
    """Final parts read since the final split was opened, SHA-256 by name."""
    return dict(_looks.get() or {})


class Ledger:
    """All evaluations on the final split, a line of JSON each, the first one first.

    Lines are added in one write, so runs at the same time don't mix theirs.

    Args:
        path: of the file; it need not exist.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)

    def entries(self) -> list[dict[str, Any]]:
        """What was evaluated, in order.

        Raises:
            StorageError: the file can't be read or holds something else.
        """
        try:
            text = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return []
        except (OSError, UnicodeDecodeError) as error:
            raise self._damaged(str(error)) from error
        if text and not text.endswith("\n"):
            raise self._damaged("its last line is cut off")
        return [self._entry(line, i) for i, line in enumerate(text.splitlines(), start=1)]

    def add(self, entry: Mapping[str, Any]) -> None:
        """Adds an evaluation.

        Raises:
            StorageError: the file is damaged or can't be written.
        """
        self.entries()  # nothing is added to a damaged file
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._damaged(str(error)) from error
        append_text(self.path, json.dumps(entry) + "\n")

    def _entry(self, line: str, number: int) -> dict[str, Any]:
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise self._damaged(f"line {number} is not JSON") from error
        if not isinstance(entry, dict):
            raise self._damaged(f"line {number} is not an entry")
        return entry

    def _damaged(self, reason: str) -> StorageError:
        return StorageError(
            f"the ledger of the final split {self.path} cannot be used ({reason}); restore it from "
            "version control"
        )
