"""Sections of results as in the thesis."""

from dataclasses import replace

import numpy as np
import pytest

from scenefw.evaluation.stacks.methods import BASE_RATE, described
from scenefw.evaluation.stacks.results import ReconstructionResult, ViewScores
from scenefw.report.blocks import Drawing
from scenefw.report.presentation import Chapter

sections = Chapter("scenefw.report.stacks").sections
OURS = "network of volumes, drawn codes (as in the thesis)"


def _view(number, visibility, **changes):
    ours = {
        "chamfer_visible": 0.02,
        "chamfer_full": 0.03,
        "occupancy_bce": 0.1,
        "instance_iou": 0.6,
        "count_error": 1.0,
    }
    methods = {
        "drawn_codes": ours | changes,
        "partial_tsdf": {name: 2 * value for name, value in ours.items()},
        "connected_components": {"instance_iou": 0.3, "count_error": 2.0},
    }
    floors = {"chamfer_visible": 0.016, "chamfer_full": 0.024}
    return ViewScores(number // 2, number % 2, visibility, floors, methods)


def test_reconstruction_beside_the_thesis(tmp_path):
    views = (_view(0, 0.25), _view(1, 0.45, chamfer_full=0.05), _view(2, 0.45))
    methods = ("drawn_codes", "partial_tsdf", "connected_components")
    worth, beside, instances, by_visibility = sections(
        ReconstructionResult(views, methods, samples=3, seed=7), tmp_path
    )
    assert dict(worth.blocks[0].rows)[OURS][:2] == (
        pytest.approx(np.mean([(0.001 + 0.021) / 2 * 1000 + 5, 6.0])),  # scenes count alike
        "6.0 to 16.0",
    )
    table, _, surfaces = beside.blocks
    rows = dict(table.rows)
    assert rows[OURS][2] == pytest.approx(np.mean([0.03, 0.05, 0.03]))
    assert rows[OURS][3] == pytest.approx(np.std([0.03, 0.05, 0.03]))
    assert rows["floor: truth sampled twice"] == pytest.approx((0.016, 0, 0.024, 0, None, None))
    assert rows["SIMstack (thesis)"] == (0.016, 0.0002, 0.028, 0.0003, 0.089, 0.003)
    assert rows["SSCNet** (thesis)"][:2] == (0.036, 0.002)
    assert not any("components" in name for name in rows)  # it has no surface of its own
    assert "3 views of 2 test scenes, 3 samples per view, seed 7" in table.note
    assert dict(surfaces.rows)[OURS][0] == pytest.approx(4.0)  # mm over the floor
    found = dict(instances.blocks[0].rows)
    assert found["components of the network's shape (no votes)"][0] == pytest.approx(0.3)
    drawing, bins = by_visibility.blocks[:2]
    assert isinstance(drawing, Drawing)
    assert [column.name for column in bins.columns] == ["20%–30%", "40%–50%"]
    assert dict(bins.rows)["views"] == ("1", "2")
    assert dict(bins.rows)[OURS] == pytest.approx((6.0, np.mean([26.0, 6.0])))


def test_objects_by_pixels_stand_beside_instances(tmp_path):
    views = [
        replace(_view(0, 0.25), pixels=(0, 40), objects={"drawn_codes": (0.0, 0.4)}),
        replace(_view(1, 0.25), pixels=(70, 20_000), objects={"drawn_codes": (0.8, 0.9)}),
    ]
    result = ReconstructionResult(tuple(views), ("drawn_codes",), samples=3, seed=7)
    _, _, instances, _ = sections(result, tmp_path)
    table = instances.blocks[1]
    assert [column.name for column in table.columns] == ["none", "1 to 99", "10,000 or more"]
    assert dict(table.rows)[f"{OURS}: found"] == pytest.approx((0, 0.5, 1))
    assert dict(table.rows)[f"{OURS}: IoU"] == pytest.approx((0, 0.6, 0.9))
    assert dict(table.rows)["share of all objects (%)"] == ("25.0", "50.0", "25.0")
    assert "4 objects" in table.note


def test_a_forecast_without_an_image_comes_with_a_word_on_the_measure(tmp_path):
    view = _view(0, 0.25)
    blind = replace(view, methods=view.methods | {BASE_RATE: {"occupancy_bce": 0.07}})
    result = ReconstructionResult((blind,), ("drawn_codes", BASE_RATE), samples=3, seed=7)
    _, beside, *_ = sections(result, tmp_path)
    table, words, *_ = beside.blocks
    assert "no measure of skill" in words.text
    row = described(BASE_RATE).row
    assert dict(table.rows)[row][4] == pytest.approx(0.07)
    assert row in table.quoted
