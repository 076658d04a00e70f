import re

import pytest

from scenefw.core.measures import Measure
from scenefw_sweeps.figure import sweep_figure
from scenefw_sweeps.gathered_runs import Run, RunsResult

COLUMNS = {
    "iou": Measure("IoU", better="higher"),
    "chamfer": Measure("Chamfer", unit="mm", factor=1000.0),
    "same": Measure("alike"),
}


def figure(*settings):
    """Runs with these settings; number i has an IoU of i / 10."""
    runs = [
        Run(str(i), {"iou": i / 10, "chamfer": i / 1000, "same": 1.0}, one)
        for i, one in enumerate(settings)
    ]
    return sweep_figure(RunsResult(tuple(runs), COLUMNS, ()))


def words(svg):
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def test_numbers_are_along_x_and_the_rest_are_lines():
    rates = ("0.1", "0.01", "0.001")
    svg, caption = figure(*({"rate": r, "model": m} for r in rates for m in ("a", "b")))
    said = words(svg)
    assert caption == "Figures over rate."
    assert {"model=a", "model=b", "IoU", "Chamfer (mm)"} <= set(said)
    assert said.count("rate") == 2  # a panel for each figure that differs
    assert "alike" not in said


def test_runs_of_other_seeds_are_dots_about_a_mean():
    seeds = [{"model": m, "seed": str(s)} for m in ("a", "b") for s in range(3)]
    svg, caption = figure(*seeds)
    assert caption == "Figures of each setting; dots: runs, bars: their means."
    assert words(svg).count("model=a") == 1
    several = figure(*({"rate": "1", "seed": str(s)} for s in range(3)), {"rate": "2", "seed": "0"})
    assert several[1] == "Figures over rate; dots: runs, lines: their means."


@pytest.mark.parametrize("settings", [[{}, {}], [{"seed": "0"}, {"seed": "1"}], [{"a": "nan"}, {}]])
def test_whatever_runs_differ_in_there_is_a_figure(settings):
    svg, caption = figure(*settings)
    assert svg.startswith("<svg")
    assert caption


def test_gaps_are_left():
    runs = (
        Run("0", {"iou": 0.1}, {"n": "1"}),
        Run("1", {}, {"n": "2"}),
        Run("2", {"iou": 0.3}, {"n": "4"}),
    )
    svg, _ = sweep_figure(RunsResult(runs, COLUMNS, ()))
    assert "Chamfer (mm)" not in words(svg)
