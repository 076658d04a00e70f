"""Figures of all runs of a sweep, side by side."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import in_order


@dataclass(frozen=True)
class ShownFigure:
    """A figure that is worth a column.

    Args:
        figure: its name in `metrics.json`.
        heading: what stands above the column.
        digits: decimals.
        better: lower, higher, or None.
        factor: multiplies it, as 1000 makes millimetres of metres.
    """

    figure: str
    heading: str
    digits: int = 3
    better: str | None = None
    factor: float = 1.0


@dataclass(frozen=True)
class Run:
    """One run of a sweep.

    Args:
        name: the overrides that not all runs share.
        figures: all it found, by name.
    """

    name: str
    figures: Mapping[str, float]


@dataclass(frozen=True)
class RunsResult:
    """Runs in the order of their numbers, and which figures to show."""

    runs: tuple[Run, ...]
    columns: tuple[ShownFigure, ...]
    shared: tuple[str, ...]

    @property
    def figures(self) -> dict[str, float]:
        """The shown figures, as `<run>/<figure>`."""
        return {
            f"{run.name}/{column.figure}": run.figures[column.figure]
            for run in self.runs
            for column in self.columns
            if column.figure in run.figures
        }


class GatheredRuns:
    """Reads the runs of a sweep from their folders (`metrics.json`, `run.json`).

    Args:
        input: folder of the sweep, or one above several, which holds the folders of its runs.
        columns: figures to show, by name; a heading, digits, better and factor each.

    Raises:
        ConfigError: no input is given, or a column is unusable.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - as on the command line
        columns: Mapping[str, Mapping[str, Any]],
    ) -> None:
        if input is None:
            raise ConfigError("this gathers the runs of a sweep; give input=FOLDER of the sweep")
        self.input = Path(input)
        try:
            self.columns = tuple(ShownFigure(name, **column) for name, column in columns.items())
        except TypeError as error:
            raise ConfigError(f"a column of evaluation.columns is unusable: {error}") from error

    def run(self, track: object = None) -> RunsResult:
        """All runs that came to their end.

        Raises:
            InputError: there are none.
        """
        found = in_order(path.parent for path in self.input.rglob("metrics.json"))
        if not found:
            raise InputError(
                f"no metrics.json below {self.input}; give the folder of a sweep (-m) whose runs "
                "are finished"
            )
        overrides = [_overrides(folder) for folder in found]
        shared = tuple(w for w in overrides[0] if all(w in words for words in overrides[1:]))
        own = [[w for w in words if w not in shared] for words in overrides]
        runs = [
            Run(", ".join(words) or folder.name, _read(folder / "metrics.json"))
            for words, folder in zip(own, found, strict=True)
        ]
        return RunsResult(tuple(runs), self.columns, shared)


def _overrides(folder: Path) -> Sequence[str]:
    record = folder / "run.json"
    words = _read(record).get("overrides", []) if record.is_file() else []
    return [word for word in words if not word.startswith(("paths.", "hydra."))]


def _read(path: Path) -> dict[str, Any]:
    try:
        read: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path} is damaged ({error}); make that run of the sweep anew") from error
    return read
