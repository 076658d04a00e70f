"""Figures of a sweep's runs over the settings that were varied."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scenefw.report.figures import COLOURS, INK, STYLE, to_svg

if TYPE_CHECKING:
    from scenefw_sweeps.gathered_runs import Run, RunsResult

_SEED = "seed"  # runs that differ in nothing else are repetitions
_COLUMNS = 3  # of panels
_LOGARITHMIC = 20.0  # ratio of the largest to the least value from which on
_LONGEST = 40  # letters of a name beside a panel


@dataclass(frozen=True)
class _Axes:
    """What a sweep's figure has along x, and which runs are a line, or a row, of their own.

    Args:
        along: key of the setting along x; None: it is no number, and each kind of run is a row.
        kinds: runs by name.
    """

    along: str | None
    kinds: Mapping[str, Sequence[Run]]


def sweep_figure(result: RunsResult) -> tuple[str, str]:
    """A panel per figure (SVG) and what it shows.

    The setting with the most values, if all are numbers, is along x, and every combination of the
    others is a line. Without numbers, every combination is a row. Runs that differ in the seed
    alone are dots; the line, or the bar, is their mean.

    Args:
        result: runs with at least one column. Figures that all runs have alike get no panel.
    """
    axes = _axes(result.runs)
    measures = [
        (name, measure) for name, measure in result.columns.items() if _varies(result, name)
    ]
    columns = min(_COLUMNS, max(1, len(measures)))
    rows = -(-len(measures) // columns)
    height = 2.6 if axes.along else max(1.6, 0.8 + 0.24 * len(axes.kinds))
    colours = dict(zip(axes.kinds, itertools.cycle(COLOURS)))
    draw = _lines if axes.along else _rows
    with rc_context(STYLE):
        figure = Figure(figsize=(4.0 * columns, height * rows), layout="constrained")
        first: Any = None
        for number, (name, measure) in enumerate(measures, 1):
            unit = f" ({measure.unit})" if measure.unit else ""
            share = {} if axes.along or first is None else {"sharey": first}
            panel: Any = figure.add_subplot(
                rows, columns, number, title=measure.heading + unit, **share
            )
            first = first or panel
            draw(panel, axes, name, measure.shown, colours)
            panel.grid(alpha=0.15, color=INK)
            if not axes.along and (number - 1) % columns:
                panel.tick_params(labelleft=False)
        if axes.along and len(axes.kinds) > 1:
            handles = [Line2D([], [], color=colours[name], marker="o") for name in axes.kinds]
            names = [_short(name) for name in axes.kinds]
            figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 3))
        return to_svg(figure), _caption(axes)


def _varies(result: RunsResult, name: str) -> bool:
    return len({run.figures[name] for run in result.runs if name in run.figures}) > 1


def _axes(runs: Sequence[Run]) -> _Axes:
    values: dict[str, list[str | None]] = {
        key: [run.settings.get(key) for run in runs]
        for key in dict.fromkeys(key for run in runs for key in run.settings)
        if key != _SEED
    }
    numbers = {
        key: len(set(settings)) for key, settings in values.items() if _all_numbers(settings)
    }
    along = max(numbers, key=numbers.__getitem__) if numbers else None
    kinds: dict[str, list[Run]] = {}
    for run in runs:
        words = [f"{k}={v}" for k, v in run.settings.items() if k not in (_SEED, along)]
        kinds.setdefault(", ".join(words), []).append(run)
    if along is None and list(kinds) == [""]:  # they differ in their seeds, or in nothing
        kinds = {run.name: [run] for run in runs}
    return _Axes(along, kinds)


def _all_numbers(values: Sequence[str | None]) -> bool:
    return all(value is not None and _number(value) is not None for value in values)


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _lines(
    panel: Any,
    axes: _Axes,
    name: str,
    convert: Callable[[float], float],
    colours: Mapping[str, str],
) -> None:
    """A line per kind of run through the means of its repetitions."""
    places = []
    for kind, runs in axes.kinds.items():
        at: dict[float, list[float]] = {}
        for run in runs:
            if name in run.figures:
                at.setdefault(float(run.settings[axes.along or ""]), []).append(
                    convert(run.figures[name])
                )
        x = sorted(at)
        places += x
        panel.plot(x, [np.mean(at[place]) for place in x], color=colours[kind])
        for place in x:
            panel.plot([place] * len(at[place]), at[place], "o", color=colours[kind], markersize=4)
    if places and min(places) > 0 and max(places) > _LOGARITHMIC * min(places):
        panel.set_xscale("log")
    panel.set_xlabel(axes.along)


def _rows(
    panel: Any,
    axes: _Axes,
    name: str,
    convert: Callable[[float], float],
    colours: Mapping[str, str],
) -> None:
    """A row per kind of run: a dot for each, a bar at their mean."""
    for row, (kind, runs) in enumerate(axes.kinds.items()):
        values = [convert(run.figures[name]) for run in runs if name in run.figures]
        if values:
            panel.plot(values, [row] * len(values), "o", color=colours[kind], markersize=4)
            panel.plot([np.mean(values)] * 2, [row - 0.3, row + 0.3], color=colours[kind])
    panel.set_yticks(range(len(axes.kinds)), [_short(kind) for kind in axes.kinds])
    panel.set_ylim(len(axes.kinds) - 0.5, -0.5)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"…{name[1 - _LONGEST :]}"


def _caption(axes: _Axes) -> str:
    over = f"Figures over {axes.along}" if axes.along else "Figures of each setting"
    places = [
        (kind, run.settings.get(axes.along or ""))
        for kind, runs in axes.kinds.items()
        for run in runs
    ]
    if len(set(places)) == len(places):
        return f"{over}."
    return f"{over}; dots: runs, {'lines' if axes.along else 'bars'}: their means."
