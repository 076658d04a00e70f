"""Stored runs: their figures, and how they were made."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from scenefw.core.errors import InputError
from scenefw.core.measures import Measures, read_measures
from scenefw.report.record import command_line, read_record, used_weights


@dataclass(frozen=True)
class StoredRun:
    """A finished run.

    Args:
        path: of its figures.
        figures: by name, as in `metrics.json`.
        record: of `run.json`: seed, versions, command line, weights; empty if there is none.
        measures: of the figures, by name; empty if an earlier version wrote the run.
    """

    path: Path
    figures: Mapping[str, float]
    record: Mapping[str, Any]
    measures: Measures = field(default_factory=dict)

    @property
    def origin(self) -> str:
        """Command, commit, seed and weights in one line, as a comment of a shell."""
        commit = str(self.record.get("versions", {}).get("commit", "unknown"))[:10]
        facts = [f"commit {commit}", f"seed {self.record.get('seed', 'unknown')}"]
        return f"{command_line(self.record)}  # {', '.join(facts + used_weights(self.record))}"


def read_runs(paths: Sequence[str | Path]) -> tuple[StoredRun, ...]:
    """The runs of folders, or of the `metrics.json` in them.

    Raises:
        InputError: a file is missing, damaged, or holds no figures.
    """
    return tuple(_read_run(Path(path)) for path in paths)


def _read_run(path: Path) -> StoredRun:
    path = path / "metrics.json" if path.is_dir() else path
    if not path.is_file():
        raise InputError(f"no figures at {path}; give the folder of a finished run=evaluate")
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
        record = read_record(path.parent)
    except ValueError as error:
        raise InputError(f"{path} or run.json beside it is damaged ({error})") from error
    if not isinstance(figures, dict) or not all(
        isinstance(v, int | float) for v in figures.values()
    ):
        raise InputError(f"{path} holds no figures by name; give the metrics.json of a run")
    return StoredRun(path, figures, record, read_measures(path.parent))
