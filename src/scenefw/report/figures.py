"""Line figures as SVG that takes the page's text colour, so that they read on light and on dark."""

import csv
import io
import itertools
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from scenefw.core.errors import StorageError

Curve = Sequence[tuple[float, float]]

_INK = "#010203"  # stands for the page's text colour, put in by `to_svg`
_STYLE = {
    "svg.fonttype": "none",
    "svg.hashsalt": "scenefw",
    "font.family": "sans-serif",
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "legend.frameon": False,
    **dict.fromkeys(
        ["text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"], _INK
    ),
}
COLOURS = ("#4477cc", "#dd7733", "#339966", "#bb4477", "#8866bb", "#aa9922", "#3399aa")
"""Of curves, in their order; each stands out from white and from near-black."""


def read_curves(path: Path | str) -> dict[str, Curve]:
    """Curves (step, value) by name from the table that training writes: a row per step and name.

    Raises:
        StorageError: the file can't be read or is no such table.
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
            f"{path} is no table of losses with columns step, name and value ({error}); give the "
            "losses.csv of a training"
        ) from error
    return dict(curves)


def loss_figure(curves: Mapping[str, Curve], *, width: float = 4.2, height: float = 2.6) -> str:
    """One panel per loss term on a logarithmic axis, training and validation in it together (SVG).

    Args:
        curves: by name; `train/tsdf`, `train_tsdf` and `val/tsdf` belong to the term `tsdf`.
        width: of a panel (inches).
        height: of a panel (inches).
    """
    panels: dict[str, dict[str, Curve]] = {}
    for name, curve in curves.items():
        stage, term = _split(name)
        panels.setdefault(term, {})[stage] = curve
    panels = dict(sorted(panels.items(), key=lambda item: (item[0] != "loss", item[0])))
    columns = min(3, max(1, len(panels)))
    rows = -(-len(panels) // columns)
    with rc_context(_STYLE):
        figure = Figure(figsize=(width * columns, height * rows), layout="constrained")
        for i, (term, stages) in enumerate(panels.items()):
            axes = figure.add_subplot(rows, columns, i + 1, title=term)
            for (stage, curve), colour in zip(sorted(stages.items()), COLOURS, strict=False):
                x, y = zip(*curve, strict=True)
                axes.plot(x, y, color=colour, label=stage, marker="." if len(x) < 20 else "")
            if all(value > 0 for curve in stages.values() for _, value in curve):
                axes.set_yscale("log")
            axes.set_xlabel("step")
            if len(stages) > 1 or next(iter(stages)):
                axes.legend()
        return to_svg(figure)


def bin_figure(
    title: str,
    edges: Sequence[float],
    lines: Mapping[str, Sequence[float | None]],
    *,
    x_label: str,
    y_label: str,
) -> str:
    """Means per bin as one line per method (SVG); bins without views are gaps."""
    centres = [(a + b) / 2 for a, b in itertools.pairwise(edges)]
    with rc_context(_STYLE):
        figure = Figure(figsize=(5.2, 3.2), layout="constrained")
        axes = figure.add_subplot(title=title, xlabel=x_label, ylabel=y_label)
        for (name, values), colour in zip(lines.items(), COLOURS, strict=False):
            heights = [float("nan") if v is None else v for v in values]
            axes.plot(centres, heights, color=colour, label=name, marker="o", markersize=4)
        axes.set_xlim(edges[0], edges[-1])
        axes.grid(alpha=0.2, color=_INK)
        axes.legend()
        return to_svg(figure)


def to_svg(figure: Figure) -> str:
    """The figure as an `<svg>` element with no background, its ink in the page's text colour."""
    buffer = io.StringIO()
    with rc_context(_STYLE):
        FigureCanvasSVG(figure).print_figure(
            buffer, format="svg", facecolor="none", edgecolor="none", metadata={"Date": None}
        )
    text = buffer.getvalue()
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    return text[text.index("<svg") :].replace(_INK, "currentColor")


def _split(name: str) -> tuple[str, str]:
    """(stage, term): ("val", "tsdf") of `val/tsdf`, `val_tsdf`; ("", name) without a stage."""
    found = re.match(r"(train|val|test)[/_](.+)", name)
    return (found[1], found[2]) if found else ("", name)
