"""Measures as headings of columns, names of rows, and cells."""

from collections.abc import Mapping

from scenefw.core.measures import HIGH, LOW, Measure
from scenefw.report.tables import Column

_ARROWS = {"lower": " ↓", "higher": " ↑", None: ""}


def column(measure: Measure, *, unit: bool = True, ranked: bool = True) -> Column:
    """The column of a measure.

    Args:
        measure: what stands in it.
        unit: whether the heading says it.
        ranked: whether the best figure is printed bold.
    """
    heading = f"{measure.heading} ({measure.unit})" if unit and measure.unit else measure.heading
    return Column(heading, measure.digits, measure.better if ranked else None)


def label(measure: Measure, figures: Mapping[str, float]) -> str:
    """Name, unit, floor and better direction, as a row heading.

    Args:
        measure: of the row.
        figures: of the same result, for the floor.
    """
    facts = [measure.unit] if measure.unit else []
    if measure.floor and measure.floor in figures:
        facts.append(f"floor {measure.text(figures[measure.floor])}")
    words = measure.name or measure.heading
    return words + (f" ({'; '.join(facts)})" if facts else "") + _ARROWS[measure.better]


def compared(
    measure: Measure, name: str, figures: Mapping[str, float]
) -> tuple[str, str | None, str | None]:
    """A figure with its bounds, the baseline's and the published one, as printed."""
    trivial = figures.get(measure.trivial) if measure.trivial else None
    theirs = (trivial, measure.published)
    without, published = (None if value is None else measure.text(value) for value in theirs)
    return measure.text(figures[name]) + _bounds(measure, name, figures), without, published


def _bounds(measure: Measure, name: str, figures: Mapping[str, float]) -> str:
    ends = [figures.get(name + end) for end in (LOW, HIGH)]
    texts = [measure.text(value) for value in ends if value is not None]
    return f" ({' to '.join(texts)})" if len(texts) == 2 else ""
