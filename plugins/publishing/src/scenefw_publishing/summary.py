"""Summary tables of a network's figures, beside baselines and published ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.measures import MEASURES_FILE, Measure
from scenefw.report.measured import compared, label
from scenefw.report.tables import Cell, Column
from scenefw_publishing.stored import StoredRun

COLUMNS = (Column("default"), Column("without learning"), Column("published"))
Row = tuple[str, tuple[Cell, ...]]
Entries = Mapping[str, Mapping[str, Any] | None]


@dataclass(frozen=True)
class Summary:
    """The figures that sum up one kind of evaluation (group `card/figures`).

    Args:
        name: one or two words.
        title: of the table; may name figures in braces, as `{scenes:.0f}`.
        needs: figures that every run of such an evaluation has.
        measures: rows, by name of figure. Each may change its measure, e.g. `{name: hybrid}`; None
            leaves a row out.
        details: further rows, in cards only.
        note: what the measures are.
    """

    name: str
    title: str
    needs: tuple[str, ...]
    measures: Entries
    details: Entries = field(default_factory=dict)
    note: str = ""

    def __post_init__(self) -> None:
        for name, changes in {**self.measures, **self.details}.items():
            _changed(Measure(name), name, changes or {})

    def within(self, run: StoredRun) -> "Part | None":
        """The part of a run that this sums up, or one of its several evaluations; None if none."""
        parts = dict.fromkeys(["", *(name.partition("/")[0] + "/" for name in run.figures)])
        for part in parts:
            if all(part + name in run.figures for name in self.needs):
                return Part(self, run, part)
        return None


@dataclass(frozen=True)
class Part:
    """A summary of one run.

    Args:
        summary: which figures, in which words.
        run: has them.
        prefix: of the names of its figures, `<part>/` or empty.
    """

    summary: Summary
    run: StoredRun
    prefix: str

    @property
    def figures(self) -> dict[str, float]:
        """The figures of the part, by the names that the summary knows."""
        return {
            name.removeprefix(self.prefix): value
            for name, value in self.run.figures.items()
            if name.startswith(self.prefix)
        }

    @property
    def title(self) -> str:
        """The title with its numbers."""
        return self.summary.title.format_map(self.figures)

    def rows(self, *, details: bool = True) -> list[Row]:
        """Rows of the figures that are there.

        Raises:
            InputError: the run has no measures, or figures by names that methods had before.
        """
        if not self.run.measures:
            raise InputError(
                f"no {MEASURES_FILE} beside {self.run.path}, which earlier versions did not write; "
                "run that evaluation again"
            )
        figures = self.run.figures
        entries = {**self.summary.measures, **(self.summary.details if details else {})}
        rows: list[Row] = []
        for short, changes in entries.items():
            name = self.prefix + short
            if changes is None:
                continue
            if name not in figures:
                self._require_todays_names(name)
                continue
            measure = _changed(self.run.measures.get(name, Measure(short)), short, changes)
            rows.append((label(measure, figures), compared(measure, name, figures)))
        return rows

    def _require_todays_names(self, missing: str) -> None:
        """A figure that the run has under the name that rows of any method once had is told."""
        for method in missing.split("/")[:-1]:
            before = missing.replace(f"{method}/", "scenefw/")
            if before in self.run.figures:
                raise InputError(
                    f"{self.run.path} has {before}, which is {missing} now; run that evaluation "
                    "again"
                )


def parts_in(run: StoredRun, among: Sequence[Summary]) -> tuple[Part, ...]:
    """The summaries that a run has figures for.

    Raises:
        InputError: none of them.
    """
    parts = tuple(part for summary in among if (part := summary.within(run)))
    if not parts:
        expected = " or ".join(", ".join(summary.needs) for summary in among)
        raise InputError(f"{run.path} has no figures to show here; expected {expected}")
    return parts


def _changed(measure: Measure, name: str, changes: Mapping[str, Any]) -> Measure:
    try:
        return measure.changed(changes)
    except ConfigError as error:
        raise ConfigError(f"measure {name} of a summary: {error}") from error
