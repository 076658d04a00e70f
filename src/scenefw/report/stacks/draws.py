"""Samples judged as samples: tables with bounds, and whether probabilities come true."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from scenefw.core.measures import Measure
from scenefw.evaluation.stacks.draw_results import DrawsResult
from scenefw.evaluation.stacks.measures import DRAWS
from scenefw.evaluation.stacks.methods import described
from scenefw.evaluation.statistics import Interval
from scenefw.metrics.forecasts import Outcomes
from scenefw.report import measured
from scenefw.report.blocks import Drawing, Section, Text
from scenefw.report.figures import COLOURS, INK, STYLE, to_svg
from scenefw.report.tables import Cell, Column, Table

_SPACE = ("log_skill", "brier_skill", "log_skill_unseen", "brier_skill_unseen", "unseen_error")
_SETS = ("distance", "distance_best_1", "distance_best_3", "distance_best_10", "spread", "energy")
_OVERLAPS = (
    "instance_iou", "instance_iou_best_3", "instance_iou_best_10", "chamfer_visible_ratio",
    "coverage",
)  # fmt: skip
_HIDDEN = ("hidden_true", "hidden_drawn", "hidden_score", "trivial_hidden_score")
_PAIRS = ("pairs_log", "pairs_skill_rate", "pairs_skill", "pairs_error")
_BOUNDED = {"log_skill", "brier_skill", "energy", "instance_iou", "pairs_skill"}
_FEWEST = 50  # events that a point of a reliability curve must have

_SPACE_WORDS = (
    "A skill is the share of the way from the forecast without an image, the mean of training "
    "scenes in each voxel (0 %), to the perfect one (100 %), in log score or Brier score. The "
    "forecast of a voxel is the mean over draws of 1 / (1 + exp(distance / voxel)), mapped to a "
    "probability by a function that never falls, fitted on views of validation scenes, for seen "
    "and for unseen voxels. The calibration error is that of the forecast before this map."
)
_SETS_WORDS = (
    "The distance between two sets of objects is 1 minus the sum of the IoUs of matched objects "
    "over the number of objects of the larger set: 0 is perfect, 1 shares nothing. Energy score: "
    "mean distance to the truth minus half the mean distance among draws; one draw alone scores "
    "its distance. Draws pay off where it falls below that of the zero code."
)
_HIDDEN_WORDS = (
    "Objects of which hardly any voxel is seen or lies just behind a seen surface: their mean "
    "number in a scene, and in draws. The score of a number is the mean distance of the draws' "
    "numbers from the true one minus half the mean distance among different draws (ranked "
    "probability score, 0 is perfect; a method that draws none scores their true number). Beside "
    "it: that of the numbers in views of validation scenes, which need no image."
)
_PAIRS_WORDS = (
    "Of pairs of visible points: the probability that both belong to one object, from the share of "
    "draws that say so, mapped as above. Skills are shares of the way from the rate of all pairs, "
    "and from the rate of pairs as far apart (the harder one), to the perfect forecast."
)


def draw_sections(result: DrawsResult) -> tuple[Section, ...]:
    """Tables of occupied space, of sets of objects and of pairs of points; reliability curves."""
    if not result.views:
        return ()
    sizes = (
        f"Of {len(result.views)} views of {result.scenes} test scenes, {result.count} draws each; "
        f"probabilities fitted on {len(result.calibration)} views of validation scenes. Ranges: 95 "
        "% bootstrap bounds over scenes."
    )
    blocks = (
        Text(sizes),
        _table(result, "Occupied space as probabilities", _SPACE, _SPACE_WORDS),
        _table(result, "Draws as sets of objects", _SETS, _SETS_WORDS),
        _table(result, "Draws one by one", _OVERLAPS, _coverage_words(result)),
        _table(result, "Hidden objects", _HIDDEN, _HIDDEN_WORDS),
        _table(result, "One object or two", _PAIRS, _PAIRS_WORDS, _trivial_rows(result)),
        Drawing(reliability_figure(result), _RELIABILITY_WORDS),
    )
    return (Section("Samples judged as samples", blocks),)


_RELIABILITY_WORDS = (
    "How often it came true (up) when draws said so with this share (right), before calibration. "
    "On the diagonal shares are probabilities; a flat curve is too sure of itself."
)


def ranged(interval: Interval, measure: Measure) -> str:
    """Bounds as printed; a dash where there are none."""
    if not np.isfinite([interval.low, interval.high]).all():
        return "–"
    return f"{measure.text(interval.low)} to {measure.text(interval.high)}"


def _table(
    result: DrawsResult,
    title: str,
    names: Sequence[str],
    note: str,
    trivial: Sequence[tuple[str, tuple[Cell, ...]]] = (),
) -> Table:
    columns, rows = [], []
    for name in names:
        columns.append(measured.column(DRAWS[name]))
        columns += [Column("95 %")] if name in _BOUNDED else []
    for method in result.methods:
        cells: list[Cell] = []
        for name in names:
            interval = result.intervals[method][name]
            cells.append(DRAWS[name].shown(interval.mean))
            cells += [ranged(interval, DRAWS[name])] if name in _BOUNDED else []
        rows.append((described(method).samples, tuple(cells)))
    quoted = frozenset(name for name, _ in trivial)
    return Table(title, tuple(columns), (*rows, *trivial), quoted, note)


def _trivial_rows(result: DrawsResult) -> list[tuple[str, tuple[Cell, ...]]]:
    """Log scores of the rates, which no method should fall behind."""
    intervals = result.intervals[result.methods[0]]
    rows = {"rate of all pairs": "pairs_log_rate", "rate by distance": "pairs_log_by_distance"}
    empty = (None,) * (len(_PAIRS) - 1 + len(_BOUNDED & set(_PAIRS)))
    return [(words, (intervals[name].mean, *empty)) for words, name in rows.items()]


def _coverage_words(result: DrawsResult) -> str:
    expected = (result.count - 1) / (result.count + 1)
    return (
        "Mean instance IoU after matching of all draws, and of the best of the first 3 and 10. "
        "Visible: Chamfer distance of visible surfaces, mean of all draws but the first by that of "
        "the first (the most typical one where a method has one): near 1 where draws agree about "
        "what is seen; 1 where there is one draw. "
        "Hidden in spread: share of hidden voxels near surfaces whose true distance lies within "
        f"the draws'; independent draws of the true distribution would reach {expected:.2f}."
    )


def reliability_figure(result: DrawsResult) -> str:
    """Two panels: unseen voxels, and pairs of visible points (SVG)."""
    panels = {"unseen voxels occupied": "unseen", "two points of one object": "pairs"}
    colours = dict(zip(result.methods, itertools.cycle(COLOURS), strict=False))
    with rc_context(STYLE):
        figure = Figure(figsize=(8.4, 3.9), layout="constrained")
        for i, (title, part) in enumerate(panels.items()):
            axes = figure.add_subplot(1, 2, i + 1, title=title, xlabel="share of draws")
            axes.set_ylabel("share that came true" if i == 0 else "")
            axes.plot([0, 1], [0, 1], color=INK, linestyle=":", linewidth=1)
            for method in result.methods:
                x, y = reliability_curve(result.reliability(method, part))
                axes.plot(x, y, color=colours[method], marker="o", markersize=3)
            axes.set(xlim=(0, 1), ylim=(0, 1))
            axes.grid(alpha=0.15, color=INK)
        handles = [Line2D([], [], color=colours[m], marker="o") for m in result.methods]
        names = [described(method).samples for method in result.methods]
        figure.legend(handles, names, loc="outside lower center", ncols=2)
        return to_svg(figure)


def reliability_curve(outcomes: Outcomes, bins: int = 12) -> tuple[list[float], list[float]]:
    """Mean forecasts and frequencies; classes joined to at most `bins` ranges of forecasts."""
    valid = outcomes.total > 0
    forecast = outcomes.forecast[valid] / outcomes.total[valid]
    place = np.minimum((forecast * bins).astype(int), bins - 1)
    sums = [
        np.bincount(place, part[valid], minlength=bins)
        for part in (outcomes.total, outcomes.forecast, outcomes.true)
    ]
    mask = sums[0] >= _FEWEST
    return (sums[1][mask] / sums[0][mask]).tolist(), (sums[2][mask] / sums[0][mask]).tolist()


def skills(result: DrawsResult | None) -> Mapping[str, Mapping[str, Interval]]:
    """Intervals by method; empty without draws."""
    return result.intervals if result is not None and result.views else {}
