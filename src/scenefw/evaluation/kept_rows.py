"""Finished parts of a long evaluation, kept in a file, so that an interrupted run goes on."""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from scenefw.core.errors import StorageError
from scenefw.core.files import append_text, write_text
from scenefw.core.versions import sources

Rows = dict[str, Any]

_SETTINGS, _RECORD = "config.yaml", "run.json"  # of the run, written before its work


class KeptRows:
    """A line of JSON for each finished part, in the folder of a run.

    The first line says what they are of: SHA-256 of the run's `config.yaml`, of the weights and
    versions in its `run.json`, and of the code. Rows of others are not used: the file starts anew.

    Args:
        folder: of the run.
        name: of the file, without its suffix; each evaluation of a run has its own.
    """

    def __init__(self, folder: Path | str, name: str = "views") -> None:
        self.folder, self.path = Path(folder), Path(folder) / f"{name}.jsonl"

    def read(self) -> Rows:
        """Rows of an interrupted run with the same settings, by key; writes the first line if none.

        A line that was cut off in the middle is left out.

        Raises:
            StorageError: the file can't be read or written.
        """
        fingerprint = self._fingerprint()
        lines = self._lines()
        rows: Rows = {}
        if lines and _parsed(lines[0]) == {"of": fingerprint}:
            for line in lines[1:]:
                entry = _parsed(line)
                if isinstance(entry, Mapping) and {"key", "row"} <= entry.keys():
                    rows[entry["key"]] = entry["row"]
        text = "".join(f"{_line(key, row)}\n" for key, row in rows.items())
        write_text(self.path, json.dumps({"of": fingerprint}) + "\n" + text)
        if rows:
            print(f"{len(rows)} finished parts of {self.path} are used again", file=sys.stderr)
        return rows

    def add(self, key: str, row: object) -> None:
        """Keeps one more part.

        Raises:
            StorageError: the file can't be written.
        """
        append_text(self.path, f"{_line(key, row)}\n")

    def discard(self) -> None:
        """All parts are finished: a later run computes them anew."""
        self.path.unlink(missing_ok=True)

    def _lines(self) -> list[str]:
        try:
            return self.path.read_text(encoding="utf-8").splitlines()
        except FileNotFoundError:
            return []
        except (OSError, UnicodeDecodeError) as error:
            raise StorageError(f"cannot read {self.path}: {error}; remove it") from error

    def _fingerprint(self) -> str:
        settings, record = self.folder / _SETTINGS, self.folder / _RECORD
        text = settings.read_bytes() if settings.is_file() else b""
        weights: Any = {}
        if record.is_file():
            contents = json.loads(record.read_text(encoding="utf-8"))
            weights = [contents.get("weights"), contents.get("versions")]
        provenance = [weights, sources()]
        return hashlib.sha256(text + json.dumps(provenance, sort_keys=True).encode()).hexdigest()


def kept_or_made(
    row_store: KeptRows | None,
    items: Mapping[str, Any],
    make: Callable[[list[Any], Callable[[Any, Any], None]], list[Any]],
    packed: Callable[[Any], object],
    unpacked: Callable[[Any], Any],
) -> list[Any]:
    """Results of all items, in their order, those that are kept without making them.

    Args:
        row_store: where finished ones are; None makes all.
        items: by key.
        make: results of some items, in their order; calls its second argument with each item and
            its result as soon as that is there.
        packed: a result as JSON types.
        unpacked: the result of these.
    """
    if row_store is None:
        return make(list(items.values()), lambda *_: None)
    rows = {key: row for key, row in row_store.read().items() if key in items}
    keys = {id(item): key for key, item in items.items()}
    pending = [item for key, item in items.items() if key not in rows]
    results = make(pending, lambda item, result: row_store.add(keys[id(item)], packed(result)))
    fresh = {keys[id(item)]: result for item, result in zip(pending, results, strict=True)}
    row_store.discard()
    return [fresh[key] if key in fresh else unpacked(rows[key]) for key in items]


def _line(key: str, row: object) -> str:
    return json.dumps({"key": key, "row": row})


def _parsed(line: str) -> object:
    try:
        return json.loads(line)
    except ValueError:
        return None
