"""Figures of labelling: curves with bounds, and maps over two amounts of noise (SVG)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from scenefw.evaluation.statistics import Interval
from scenefw.report.figures import COLOURS, INK, STYLE, to_svg


@dataclass(frozen=True)
class Panel:
    """One panel of curves.

    Args:
        title: above it.
        x_label: below it.
        curves: (x, y with bounds) by name.
        levels: horizontal lines by name, e.g. published figures.
    """

    title: str
    x_label: str
    curves: Mapping[str, tuple[Sequence[float], Sequence[Interval]]]
    levels: Mapping[str, float]


def bounds_figure(panels: Sequence[Panel], y_label: str) -> str:
    """Panels of shares in [0, 1]; each curve with its bounds as a band, one legend below all."""
    names = list(dict.fromkeys(name for panel in panels for name in panel.curves))
    colours = dict(zip(names, itertools.cycle(COLOURS), strict=False))
    with rc_context(STYLE):
        figure = Figure(figsize=(4.4 * len(panels), 3.4), layout="constrained")
        for i, panel in enumerate(panels):
            axes = figure.add_subplot(1, len(panels), i + 1, title=panel.title)
            axes.set(xlabel=panel.x_label, ylabel=y_label if i == 0 else "")
            _panel(axes, panel, colours)
        handles = [Line2D([], [], color=colours[n], marker="o", markersize=4) for n in names]
        levels = {name: level for panel in panels for name, level in panel.levels.items()}
        handles += [Line2D([], [], color=_colour(n, colours), linestyle=":") for n in levels]
        names += [f"{name}: {level:.3f}" for name, level in levels.items()]
        figure.legend(handles, names, loc="outside lower center", ncols=min(len(names), 5))
        return to_svg(figure)


def _panel(axes: Any, panel: Panel, colours: Mapping[str, str]) -> None:
    for name, (x, points) in panel.curves.items():
        low = [p.mean if np.isnan(p.low) else p.low for p in points]
        high = [p.mean if np.isnan(p.high) else p.high for p in points]
        axes.fill_between(x, low, high, color=colours[name], alpha=0.15, linewidth=0)
        axes.plot(x, [p.mean for p in points], color=colours[name], marker="o", markersize=4)
    for name, level in panel.levels.items():
        axes.axhline(level, color=_colour(name, colours), linestyle=":", linewidth=1)
    means = [p.mean for _, points in panel.curves.values() for p in points]
    minimum = np.nanmin([*means, *panel.levels.values(), 1.0])
    axes.set_ylim(max(0.0, np.floor(10 * minimum) / 10), 1)  # good strategies differ little
    axes.grid(alpha=0.15, color=INK)


def _colour(level: str, colours: Mapping[str, str]) -> str:
    """That of the curve whose name a level ends with."""
    return next((colour for name, colour in colours.items() if level.endswith(name)), INK)


def noise_figure(
    grids: Mapping[str, NDArray[np.float64]], pose: Sequence[float], depth: Sequence[float]
) -> str:
    """A map per strategy: pose noise to the right, depth noise up, figures in the cells.

    Args:
        grids: (pose, depth) values in [0, 1] by strategy.
        pose: amounts (m).
        depth: amounts (m).
    """
    with rc_context(STYLE):
        size = (0.7 * len(pose) + 0.9, 0.45 * len(depth) + 1.0)
        figure = Figure(figsize=(size[0] * len(grids), size[1]), layout="constrained")
        for i, (name, grid) in enumerate(grids.items()):
            axes = figure.add_subplot(1, len(grids), i + 1, title=name)
            axes.pcolormesh(grid.T, cmap="viridis", vmin=0, vmax=1)
            for (column, row), value in np.ndenumerate(grid):
                colour = "#111111" if value > 0.6 else "#eeeeee"
                text = "–" if np.isnan(value) else f"{value:.2f}"
                axes.text(
                    column + 0.5, row + 0.5, text, ha="center", va="center", color=colour, size=8
                )
            axes.set_xticks(np.arange(len(pose)) + 0.5, [f"{1000 * p:g}" for p in pose])
            axes.set_yticks(np.arange(len(depth)) + 0.5, [f"{1000 * d:g}" for d in depth])
            axes.set(xlabel="pose noise (mm)", ylabel="depth noise (mm)" if i == 0 else "")
        return to_svg(figure)
