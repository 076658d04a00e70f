"""How figures are printed: name, unit, digits, which direction is better, published values."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.files import write_text

MEASURES_FILE = "measures.json"
"""Beside `metrics.json` in the folder of a run."""


LOW, HIGH = "_low", "_high"
"""Ends of the names of a figure's bounds, of 95 per cent, where it has some."""


@dataclass(frozen=True)
class Measure:
    """How a figure is printed, and what it is compared with.

    Args:
        heading: in few words, as above a column.
        name: in full, as in front of a row; empty means the heading.
        unit: of what is printed.
        digits: decimals.
        better: which figure is the better one; None = neither.
        factor: multiplies the figure, as 1000 makes millimetres of metres.
        published: value of the literature, in the unit of the figure, before the factor.
        trivial: name of the figure that a method without learning has of it.
        floor: name of the figure that no method can fall below.
    """

    heading: str
    name: str = ""
    unit: str = ""
    digits: int = 3
    better: Literal["lower", "higher"] | None = None
    factor: float = 1.0
    published: float | None = None
    trivial: str | None = None
    floor: str | None = None

    def __post_init__(self) -> None:
        if self.better not in ("lower", "higher", None):
            raise ConfigError(f"better is {self.better!r}; expected lower, higher or null")

    def within(self, part: str) -> Measure:
        """The same measure for figures with the name of a part in front."""
        return replace(
            self,
            trivial=self.trivial and f"{part}/{self.trivial}",
            floor=self.floor and f"{part}/{self.floor}",
        )

    def changed(self, changes: Mapping[str, Any]) -> Measure:
        """A copy with some arguments changed.

        Raises:
            ConfigError: there is no such argument.
        """
        names = [field.name for field in fields(self)]
        unknown = [name for name in changes if name not in names]
        if unknown:
            raise ConfigError(
                f"a measure has no {unknown[0]!r}; give {', '.join(names[:-1])} or {names[-1]}"
            )
        return replace(self, **changes)

    def shown(self, value: float) -> float:
        """A figure in the printed unit."""
        return self.factor * value

    def text(self, value: float) -> str:
        """A figure as it is printed, without its unit."""
        return f"{self.shown(value):.{self.digits}f}"


Measures = Mapping[str, Measure]
"""By the name of the figure."""


def join_measures(parts: Iterable[tuple[str, Measures]]) -> dict[str, Measure]:
    """Measures of several parts, whose figures are called `<part>/<figure>`."""
    return {
        f"{part}/{name}": measure.within(part)
        for part, measures in parts
        for name, measure in measures.items()
    }


def write_measures(folder: Path, measures: Measures) -> None:
    """Writes `measures.json`, which says what the figures in `metrics.json` are.

    Raises:
        StorageError: the folder can't be written.
    """
    plain = {name: _plain(measure) for name, measure in measures.items()}
    write_text(folder / MEASURES_FILE, json.dumps(plain, indent=1, ensure_ascii=False) + "\n")


def read_measures(folder: Path) -> dict[str, Measure]:
    """What `write_measures` wrote; empty if there is no such file.

    Raises:
        InputError: the file is damaged.
    """
    path = folder / MEASURES_FILE
    if not path.is_file():
        return {}
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        return {name: Measure(**entry) for name, entry in entries.items()}
    except (OSError, ValueError, TypeError, AttributeError, ConfigError) as error:
        raise InputError(f"{path} is damaged ({error}); run that evaluation again") from error


def _plain(measure: Measure) -> dict[str, Any]:
    """All arguments that differ from their defaults."""
    values = {
        field.name: (getattr(measure, field.name), field.default) for field in fields(measure)
    }
    return {name: value for name, (value, default) in values.items() if value != default}
