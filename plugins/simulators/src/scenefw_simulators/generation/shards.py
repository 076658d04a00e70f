"""Attempts in shards that survive a kill: a rerun makes those that are missing or damaged."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenefw.core.errors import StorageError
from scenefw.core.files import require_writable

Shard = tuple[Path, tuple[int, int]]
"""A file, and its first attempt and the one after its last."""


@dataclass(frozen=True)
class Shards:
    """Files of one data set, in a folder named by a digest of all that decides what comes out.

    Args:
        folder: of the shards of all data sets.
        facts: that decide, as plain data; others start afresh.
        attempts: in all shards.
        size: attempts per shard.
        load: reads a finished shard; of others it raises a StorageError.
        prefix: of the name of the folder.
    """

    folder: str | Path
    facts: Mapping[str, Any]
    attempts: int
    size: int
    load: Callable[[Path], object]
    prefix: str = ""

    def all(self) -> list[Shard]:
        """Every shard; makes the folder.

        Raises:
            StorageError: it can't be written.
        """
        digest = hashlib.sha256(json.dumps(self.facts, sort_keys=True).encode()).hexdigest()[:12]
        folder = require_writable(Path(self.folder) / f"{self.prefix}{digest}")
        starts = range(0, self.attempts, self.size)
        ranges = [(start, min(start + self.size, self.attempts)) for start in starts]
        return [(folder / f"{start:07d}-{stop:07d}.npz", (start, stop)) for start, stop in ranges]

    def missing(self) -> list[Shard]:
        """Those that are yet to be made."""
        return [shard for shard in self.all() if not self._is_complete(shard[0])]

    def _is_complete(self, path: Path) -> bool:
        try:
            self.load(path)
        except StorageError:
            return False
        return True
