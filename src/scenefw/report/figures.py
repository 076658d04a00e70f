"""Line figures as SVG that takes the page's text colour, readable on light and dark backgrounds."""

import csv
import io
import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from scenefw.core.errors import StorageError
from scenefw.report.svg import compact

Curve = Sequence[tuple[float, float]]

INK = "#010203"  # placeholder of the page's text colour, replaced by `to_svg`
STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "scenefw",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "legend.frameon": False,
    **dict.fromkeys(
        ["text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"], INK
    ),
}
COLOURS = ("#4477cc", "#dd7733", "#339966", "#bb4477", "#8866bb", "#aa9922", "#3399aa")
"""Of curves, in their order; each stands out from white and from near-black."""


def read_curves(path: Path | str) -> dict[str, Curve]:
    """Curves (step, value) by name from the table that training writes: a row per step and name.

    Raises:
        StorageError: the file can't be read or is not such a table.
    """
    curves: dict[str, list[tuple[float, float]]] = {}
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                curves.setdefault(row["name"], []).append((float(row["step"]), float(row["value"])))
    except OSError as error:
        raise StorageError(f"cannot read the losses {path}: {error.strerror}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise StorageError(
            f"{path} is not a table of losses with columns step, name and value ({error}); give "
            "the losses.csv of a training"
        ) from error
    return dict(curves)


def loss_figure(curves: Mapping[str, Curve]) -> str:
    """One panel per loss and score, training and validation in it together (SVG).

    Args:
        curves: by name; `train/tsdf` and `val/tsdf` belong to one panel.
    """
    panels: dict[str, dict[str, Curve]] = {}
    for name, curve in curves.items():
        stage, _, term = name.rpartition("/")
        panels.setdefault(term, {})[stage] = curve
    order = sorted(panels, key=lambda term: (term != "total", "train" not in panels[term], term))
    columns = min(3, max(1, len(order)))
    rows = -(-len(order) // columns)
    with rc_context(STYLE):
        figure = Figure(figsize=(4.0 * columns, 2.5 * rows), layout="constrained")
        for i, term in enumerate(order):
            _loss_panel(figure.add_subplot(rows, columns, i + 1, title=term), panels[term])
        return to_svg(figure)


def _loss_panel(axes: Any, stages: Mapping[str, Curve]) -> None:
    colours = {"train": COLOURS[0], "val": COLOURS[1]}
    for stage, curve in stages.items():
        x, y = zip(*curve, strict=True)
        marker = "." if len(x) < 20 else ""
        axes.plot(x, y, color=colours.get(stage, COLOURS[2]), label=stage, marker=marker)
    values = [value for curve in stages.values() for _, value in curve]
    if "train" in stages and min(values) > 0 and max(values) > 10 * min(values):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("step")
    axes.legend()


def bin_figure(
    edges: Sequence[float], panels: Mapping[str, Mapping[str, Sequence[float | None]]], x_label: str
) -> str:
    """Means per bin, a panel per figure and a line per method, in one row with one legend (SVG).

    Args:
        edges: of the bins, one more than values.
        panels: values by title and method; None where a bin holds nothing.
        x_label: what the bins are of.
    """
    centres = [(a + b) / 2 for a, b in itertools.pairwise(edges)]
    methods = list(dict.fromkeys(name for lines in panels.values() for name in lines))
    colours = dict(zip(methods, itertools.cycle(COLOURS)))
    with rc_context(STYLE):
        figure = Figure(figsize=(4.0 * len(panels), 3.0), layout="constrained")
        for i, (title, lines) in enumerate(panels.items()):
            axes = figure.add_subplot(1, len(panels), i + 1, title=title, xlabel=x_label)
            for name, values in lines.items():
                heights = [float("nan") if v is None else v for v in values]
                axes.plot(centres, heights, color=colours[name], marker="o", markersize=4)
            axes.set_ylim(bottom=0)
            axes.grid(alpha=0.15, color=INK)
        handles = [
            Line2D([], [], color=colours[name], marker="o", markersize=4) for name in methods
        ]
        figure.legend(handles, methods, loc="outside lower center", ncols=min(len(methods), 4))
        return to_svg(figure)


def to_svg(figure: Figure) -> str:
    """The figure as an `<svg>` element with no background, its ink in the page's text colour."""
    buffer = io.StringIO()
    with rc_context(STYLE):
        FigureCanvasSVG(figure).print_figure(
            buffer, format="svg", facecolor="none", edgecolor="none", metadata={"Date": None}
        )
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    return compact(text[text.index("<svg") :]).replace(INK, "currentColor")
