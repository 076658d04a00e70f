"""Figures of all runs of a sweep, side by side."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import in_order
from scenefw.core.measures import MEASURES_FILE, Measure, join_measures, read_measures

_FEW = 9  # columns, where none of those asked for is there
_TRAINING = ("train/", "val/")  # figures of a training


@dataclass(frozen=True)
class Run:
    """One run of a sweep.

    Args:
        name: the overrides that not all runs share.
        figures: all it found, by name.
        settings: those overrides, value by key.
    """

    name: str
    figures: Mapping[str, float]
    settings: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class RunsResult:
    """Runs in the order of their numbers, the figures to show of them, and what all runs share."""

    runs: tuple[Run, ...]
    columns: Mapping[str, Measure]
    shared: tuple[str, ...]

    @property
    def figures(self) -> dict[str, float]:
        """The shown figures, as `<run>/<figure>`."""
        return {
            f"{run.name}/{name}": run.figures[name]
            for run in self.runs
            for name in self.columns
            if name in run.figures
        }

    @property
    def measures(self) -> dict[str, Measure]:
        """Those of the columns, for every run."""
        return join_measures((run.name, self.columns) for run in self.runs)


class GatheredRuns:
    """Reads the runs of a sweep from their folders (`metrics.json`, `measures.json`, `run.json`).

    Args:
        input: folder of the sweep, or one above several, which holds the folders of its runs.
        columns: figures to show, by name in `metrics.json`. Each may change its measure, e.g.
            `{heading: BCE}`; None leaves a column out. Figures that no run has are left out too; if
            the runs have none of them, some in which they differ are shown instead.

    Raises:
        ConfigError: no input is given, or a column is unusable.
    """

    def __init__(
        self,
        input: str | Path | None,  # noqa: A002 - as on the command line
        columns: Mapping[str, Mapping[str, Any] | None],
    ) -> None:
        if input is None:
            raise ConfigError("gathering needs the runs of a sweep; give input=FOLDER of the sweep")
        self.input = Path(input)
        self.columns = {name: entry for name, entry in columns.items() if entry is not None}
        for name, changes in self.columns.items():
            _changed(Measure(name), name, changes)

    def run(self, track: object = None) -> RunsResult:
        """All runs that finished.

        Raises:
            InputError: there are none, a file is damaged, no run has a figure to show, or none has
                measures.
        """
        folders = in_order(path.parent for path in self.input.rglob("metrics.json"))
        if not folders:
            raise InputError(
                f"no metrics.json below {self.input}; give the folder of a sweep (-m) whose runs "
                "are finished"
            )
        overrides = [_overrides(folder) for folder in folders]
        shared = tuple(w for w in overrides[0] if all(w in words for words in overrides[1:]))
        distinct_overrides = [[w for w in words if w not in shared] for words in overrides]
        runs = tuple(
            Run(
                ", ".join(words) or folder.name,
                _read_json(folder / "metrics.json"),
                _settings(words),
            )
            for words, folder in zip(distinct_overrides, folders, strict=True)
        )
        return RunsResult(runs, self._columns(runs, self._measures(folders, runs)), shared)

    def _measures(self, folders: Sequence[Path], runs: Sequence[Run]) -> dict[str, Measure]:
        """The measures of all runs; the first run counts where they differ. Trainings have none."""
        measures: dict[str, Measure] = {}
        for folder in reversed(folders):
            measures |= read_measures(folder)
        evaluated = any(not name.startswith(_TRAINING) for run in runs for name in run.figures)
        if not measures and evaluated:
            raise InputError(
                f"no {MEASURES_FILE} beside the figures below {self.input}, which earlier versions "
                "did not write; run the sweep again"
            )
        return measures

    def _columns(self, runs: Sequence[Run], measures: Mapping[str, Measure]) -> dict[str, Measure]:
        """The columns that a run has figures for, else some that differ; each with its heading."""
        requested = {
            name: c for name, c in self.columns.items() if any(name in r.figures for r in runs)
        }
        columns: dict[str, Measure] = {}
        for name, changes in (requested or _differing(runs, measures)).items():
            measure = _changed(measures.get(name, Measure(name)), name, changes)
            if measure.heading in {column.heading for column in columns.values()}:
                part = name.partition("/")[0]
                measure = replace(measure, heading=f"{measure.heading}, {part}")
            columns[name] = measure
        if not columns:
            raise InputError(
                f"the runs below {self.input} have none of the figures {', '.join(self.columns)}; "
                "and none that differs; give evaluation.columns of theirs (metrics.json)"
            )
        return columns


def _differing(
    runs: Sequence[Run], measures: Mapping[str, Measure]
) -> dict[str, Mapping[str, Any]]:
    """Figures, with what they are of, that are not the same in all runs; a few."""
    names = [n for n in measures if all(n in run.figures for run in runs)]
    differ = [n for n in names if len({run.figures[n] for run in runs}) > 1]
    return {n: {"heading": f"{measures[n].heading}, {n}"} for n in differ[:_FEW]}


def _changed(measure: Measure, name: str, changes: Mapping[str, Any]) -> Measure:
    try:
        return measure.changed(changes)
    except ConfigError as error:
        raise ConfigError(f"evaluation.columns.{name}: {error}") from error


def _overrides(folder: Path) -> Sequence[str]:
    record = folder / "run.json"
    words = _read_json(record).get("overrides", []) if record.is_file() else []
    return [word for word in words if not word.startswith(("paths.", "hydra."))]


def _settings(words: Sequence[str]) -> dict[str, str]:
    pairs = (word.partition("=") for word in words)
    return {key.lstrip("+~"): value for key, _, value in pairs}


def _read_json(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} is damaged ({error}); run that part of the sweep again"
        ) from error
    return content
