"""Results as sections: by a chapter's section modules, else as tables of their figures."""

import importlib
import pkgutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from scenefw.core.measures import Measure
from scenefw.core.protocols import Result
from scenefw.evaluation.several import SeveralResults
from scenefw.report.blocks import Section
from scenefw.report.measured import compared, label
from scenefw.report.tables import Cell, Column, Table

Show = Callable[[Any, Path], Sequence[Section]]
"""From a result of one class and the folder of the page to sections."""


class Figures:
    """A table of all figures, part by part where several evaluations ran; fits every result."""

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """One section, or one for each part, headed by its name."""
        return sections_by_class(result, folder, {})


class Chapter:
    """Shows results by the section modules of a package (group `presentation`).

    A module of the package that shows an evaluation holds `SECTIONS`, from classes of results to
    functions of a result and the folder of the page. Other results get a table of their figures.

    Args:
        package: dotted name.
    """

    def __init__(self, package: str) -> None:
        self.package = package

    def sections(self, result: Result, folder: Path) -> tuple[Section, ...]:
        """Sections of a result, those of several evaluations part by part."""
        shown_by: dict[type, Show] = {}
        for module in pkgutil.iter_modules(importlib.import_module(self.package).__path__):
            content = importlib.import_module(f"{self.package}.{module.name}")
            shown_by |= vars(content).get("SECTIONS", {})
        return sections_by_class(result, folder, shown_by)


def sections_by_class(
    result: Result, folder: Path, shown_by: Mapping[type, Show], title: str = "Results"
) -> tuple[Section, ...]:
    """Sections by the class of a result, those of `Several` part by part.

    Args:
        result: of an evaluation.
        folder: of the page.
        shown_by: what shows the results of a class; all others get a table of their figures.
        title: of the section of such a table.
    """
    if isinstance(result, SeveralResults):
        parts = {
            words: sections_by_class(part, folder, shown_by, words)
            for words, part in (
                (name.replace("_", " "), part) for name, part in result.parts.items()
            )
        }
        uses = Counter(section.title for sections in parts.values() for section in sections)
        return tuple(
            replace(section, title=f"{section.title}: {words}")
            if uses[section.title] > 1
            else section
            for words, sections in parts.items()
            for section in sections
        )
    show = shown_by.get(type(result))
    return tuple(show(result, folder)) if show else (Section(title, (figure_table(result),)),)


def figure_table(result: Result) -> Table:
    """A row per figure, with the baseline's and the published one, if any."""
    figures, measures = result.figures, result.measures
    labels = {n: label(measures[n], figures) if n in measures else n for n in figures}
    uses = Counter(labels.values())
    rows = [
        (
            text if uses[text] == 1 else f"{text} ({name})",
            compared(measures.get(name, Measure(name, digits=4)), name, figures),
        )
        for name, text in labels.items()
    ]
    indices = [i for i in range(3) if i == 0 or any(cells[i] is not None for _, cells in rows)]
    columns = [Column(name) for name in ("value", "without learning", "published")]
    table_rows: list[tuple[str, tuple[Cell, ...]]] = [
        (text, tuple(cells[i] for i in indices)) for text, cells in rows
    ]
    return Table("Figures", tuple(columns[i] for i in indices), tuple(table_rows))
