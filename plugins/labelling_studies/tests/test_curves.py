from dataclasses import replace

import numpy as np
import pytest
from plugins.labelling_studies.tests.test_bench import strategies
from tests.unit.labelling.fakes import CLASSES, GRID, Scenes, truth

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw_labelling_studies.bench import Bench, Snapshot
from scenefw_labelling_studies.curves import LabellingCurves, frame_counts
from scenefw_labelling_studies.noise import GatheredNoise, LabellingNoise
from scenefw_labelling_studies.results import (
    Score,
    Scores,
    read_scores,
    score,
    write_scores,
)


@pytest.fixture(scope="module")
def result():
    return LabellingCurves(Bench(Scenes(), strategies()), frames=5, steps=5, shown=3).run()


def test_scores_of_fakes_are_those_worked_out_by_hand(result):
    assert result.scores.counts == (1, 2, 3, 4, 5)
    assert result.scores.scenes == (0, 1)
    # views call the pen a book: surface right, 10 rows of book of 11 called so, no pen
    seen = np.mean([1.0, 10 / 11, 0.0])
    assert result.scores.final("view_based").mean == pytest.approx(seen)
    assert result.scores.curve("view_based", "miou_seen")[0].mean == pytest.approx(seen)
    share = 8 / GRID.vertices  # of the map after one frame
    first = np.mean([share, 10 * share / (10 + share), 0.0])
    assert result.scores.curve("view_based", "miou")[0].mean == pytest.approx(first)
    assert result.scores.curve("view_based", "coverage")[1].mean == pytest.approx(2 * share)
    # the map calls half of the book a pen: 1 of 6 rows called pen is one
    assert result.class_iou["map_based"] == pytest.approx([1.0, 0.5, 1 / 6])
    assert result.scores.final("view_based", "height_rms").mean == pytest.approx(0, abs=1e-6)


def test_figures_and_example(result):
    figures = result.figures
    assert figures["hybrid/miou"] == pytest.approx(result.scores.final("hybrid").mean)
    assert figures["scenes"] == 2
    assert all(np.isfinite(list(figures.values())))
    example = result.example
    assert example.frames == (1, 3, 5)
    assert set(example.colour) == set(example.sources) == {1, 3, 5}
    assert len(example.labels) == 9
    np.testing.assert_array_equal(example.truth, truth().labels)


def test_advantage_is_paired(result):
    found = result.scores.advantage("view_based", "view_based")
    assert [(i.mean, i.count) for i in found] == [(0, 2)] * 5


def test_frame_counts():
    assert frame_counts(400, 4) == (100, 200, 300, 400)
    assert frame_counts(3, 10) == (1, 2, 3)
    assert frame_counts(100, 2, first=1) == (1, 50, 100)
    with pytest.raises(ConfigError, match="expected"):
        LabellingCurves(Bench(Scenes(), strategies()), frames=0)


def test_scores_go_through_files(tmp_path, result):
    assert read_scores(write_scores(tmp_path / "scores.csv", result.scores)) == result.scores
    (tmp_path / "other.csv").write_text("a,b\n1,2\n")
    for name in ("other.csv", "none.csv"):
        with pytest.raises(InputError, match="not a table"):
            read_scores(tmp_path / name)


def test_heights_are_scored_where_seen():
    heights = truth().heights + np.float32(0.001)
    heights[0] = np.nan
    heights[1] = 0.011
    one = np.ones(GRID.shape, np.float32)
    whole = truth()
    found = HeightMap(GRID, heights, whole.colour, one, one, labels=whole.labels, classes=CLASSES)
    row = score("x", 0, Snapshot(1, found, {}), whole)
    rows = GRID.vertices - 1
    assert row.height_median == pytest.approx(0.001, rel=1e-3)
    expected = np.sqrt((0.011**2 + (rows - 1) * 0.001**2) / rows)
    assert row.height_rms == pytest.approx(expected, rel=1e-3)
    assert row.coverage == pytest.approx(rows / GRID.vertices)


def test_another_grid_is_refused():
    whole, other = truth(), HeightGrid(65)
    blank = np.zeros(other.shape, np.float32)
    found = HeightMap(other, blank, np.zeros((65, 65, 3), np.uint8), blank, blank)
    with pytest.raises(InputError, match="grid"):
        score("x", 0, Snapshot(1, found, {}), whole)


def noise(pose, depth, scenes=1):
    bench = Bench(Scenes(), strategies())
    return LabellingNoise(bench, 2, pose, depth, Jitter, Gaussian, scenes)


def test_a_grid_of_noise_and_a_sweep_are_the_same(tmp_path):
    whole = noise([0.0, 0.5], [0.0, 0.01], scenes=2).run()
    assert whole.pose == (0.0, 0.5)
    assert whole.grid("hybrid").shape == (2, 2)
    quiet = noise(0.0, 0.0).run().scores.final("hybrid").mean
    assert whole.cell("hybrid", 0.0, 0.0).mean == pytest.approx(quiet)
    for i, (pose, depth) in enumerate([(0.0, 0.0), (0.0, 0.01), (0.5, 0.0), (0.5, 0.01)]):
        run = noise(pose, depth, scenes=2).run()
        write_scores(tmp_path / str(i) / "noise.csv", run.scores)
    gathered = GatheredNoise(tmp_path).run()
    for name in whole.strategies:
        np.testing.assert_array_equal(gathered.grid(name), whole.grid(name))
    assert all(np.isfinite(list(gathered.figures.values())))


def test_runs_that_are_not_of_one_sweep_are_no_noise_map(tmp_path):
    first = noise(0.0, 0.0).run().scores
    write_scores(tmp_path / "0" / "noise.csv", first)
    write_scores(tmp_path / "1" / "noise.csv", first)  # the same again
    assert GatheredNoise(tmp_path).run().scores == first
    better = Scores(tuple(replace(row, miou=row.miou / 2) for row in first.rows))
    write_scores(tmp_path / "1" / "noise.csv", better)
    with pytest.raises(InputError, match="both score view_based on scene 0"):
        GatheredNoise(tmp_path).run()
    longer = Scores(tuple(replace(row, frames=5, pose=0.5) for row in first.rows))
    write_scores(tmp_path / "1" / "noise.csv", longer)
    with pytest.raises(InputError, match="2 and 5 frames"):
        GatheredNoise(tmp_path).run()


def test_noise_of_wrong_amounts_or_no_folder(tmp_path):
    for amounts in ([], "much", [-1.0]):
        with pytest.raises(ConfigError, match=r"noise.pose.sigma"):
            noise(amounts, 0.0)
    bench = Bench(Scenes(), strategies())
    LabellingNoise(bench, 2, 0.0, 0.0, Jitter, Gaussian, chosen=["pose", "gaussian"])
    with pytest.raises(ConfigError, match="not kinect"):
        LabellingNoise(bench, 2, 0.0, 0.0, Jitter, Gaussian, chosen=["pose", "kinect"])
    with pytest.raises(ConfigError, match="input=FOLDER"):
        GatheredNoise(None)
    with pytest.raises(InputError, match=r"no noise.csv"):
        GatheredNoise(tmp_path).run()


def test_scores_of_nothing():
    row = Score("x", 0, 1, 0.5, 0.5, 0.0, 1.0, float("nan"), float("nan"))
    assert np.isnan(Scores((row,)).final("x", "height_rms").mean)
    assert np.isnan(Scores((row,)).values("y", "miou")).all()
