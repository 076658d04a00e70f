"""Rankings scored on draws that are known."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.presentation import Chapter
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_simulators.body_maker import BodyMaker
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_single_view_benchmarks.ranking import RankingEvaluation
from scenefw_single_view_benchmarks.ranking_results import RankingResult, ViewChoices

GRID = GridSpec(resolution=24)


class Told:
    """Block k is k + 1 voxels high; the first scene has the highest."""

    grid = GRID
    calibration = None

    def complete(self, partial, grid, samples, generator):
        found = []
        for number in range(samples):
            labels = torch.zeros((1, *grid.shape), dtype=torch.int32)
            low = int(np.ceil(-grid.lower[2] / grid.voxel_size))
            high = low + (9 if number == 0 else number + 1)
            labels[:, 8:14, 8:14, low:high] = 1
            found.append(Completion(torch.where(labels > 0, -0.01, 0.01), labels))
        return found


class Highest:
    """Puts the highest draw first; forgets nothing of a scene's details."""

    def rank(self, scenes):
        return [scenes[0], *sorted(scenes[1:], key=lambda one: -(one.instances > 0).sum())]


class AsDrawn:
    def rank(self, scenes):
        return [replace(one, details={**one.details, "seen": True}) for one in scenes]


def evaluation(**settings):
    settings = {"rankings": {"highest": Highest(), "drawn": AsDrawn(), "none": None}} | settings
    return RankingEvaluation(
        StackScenes(split="val", limit=2), Told(), settings.pop("rankings"),
        RandomViewpoints(width=80, height=60), SphereTracer(), Projective(), PyBulletEngine(),
        BodyMaker(), **{"draws": 4, **settings},
    )  # fmt: skip


@pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")
def test_rows_are_of_the_draws_that_rankings_put_first(tmp_path):
    pytest.importorskip("pybullet")
    result = evaluation().run()
    assert result.rows == ("first", "any", "highest", "drawn", "best")
    assert len(result.views) == 2
    for view in result.views:
        rows = view.chosen
        assert rows["best"]["instance_iou"] >= rows["any"]["instance_iou"]
        assert rows["best"]["instance_iou"] >= rows["highest"]["instance_iou"]
        # Blocks of all heights overlap with the truth by what they occupy, so they differ
        assert rows["highest"]["occupancy_iou"] != rows["drawn"]["occupancy_iou"]
        assert all(0 <= row["displacement"] <= 0.2 for row in rows.values())
    (tmp_path / "config.yaml").write_text("a: 1\n")
    (tmp_path / "run.json").write_text("{}")
    first = evaluation(kept=KeptRows(tmp_path)).run()
    assert first.views == result.views == evaluation(kept=KeptRows(tmp_path)).run().views


class Kth:
    """Puts one draw first."""

    def __init__(self, number):
        self.number = number

    def rank(self, scenes):
        return [scenes[0], scenes[self.number], *scenes[1:]]


@pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")
def test_any_is_the_mean_of_all_draws_and_best_the_best_of_them():
    pytest.importorskip("pybullet")
    result = evaluation(rankings={str(k): Kth(k) for k in range(1, 5)}).run()
    for view in result.views:
        draws = [view.chosen[str(k)] for k in range(1, 5)]
        for name, value in view.chosen["any"].items():
            assert value == pytest.approx(np.mean([one[name] for one in draws]))
        ious = [one["instance_iou"] for one in draws]
        assert view.chosen["best"] == draws[int(np.argmax(ious))]
        # Each is one voxel higher than the one before, so no two occupy the same
        assert len({one["occupancy_iou"] for one in draws}) == 4


def scores(iou, moved=0.0):
    return {"instance_iou": iou, "panoptic_quality": iou, "occupancy_iou": iou,
            "displacement": moved}  # fmt: skip


def test_gains_are_those_beyond_any_draw_of_the_same_views():
    random = np.random.default_rng(0)
    views = []
    for scene in range(40):
        level = float(random.uniform(0.2, 0.9))  # some views are hard for all
        rows = {"first": level, "any": level, "good": level + 0.05, "best": level + 0.1}
        views.append(ViewChoices(scene, {name: scores(iou) for name, iou in rows.items()}))
    result = RankingResult(tuple(views), ("good",), 7)
    gain = result.gain("good", "instance_iou")
    assert [gain.mean, gain.low, gain.high] == pytest.approx([0.05] * 3)
    wide = result.score("good", "instance_iou")
    assert wide.high - wide.low > 0.1
    (section,) = Chapter("scenefw_single_view_benchmarks.report").sections(result, None)
    (table,) = section.blocks
    assert [name for name, _ in table.rows] == [
        "the first hypothesis, which stays the first", "any draw (order by chance)",
        "first by good", "the best draw, chosen with the truth",
    ]  # fmt: skip
    assert table.rows[2][1][1] == "0.050 to 0.050"
    assert set(result.figures) <= {
        *result.measures, *(f"{n}{end}" for n in result.measures for end in ("_low", "_high")),
    }  # fmt: skip


def test_what_needs_draws_rankings_and_a_grid_says_so():
    for wrong, words in (({"draws": 1}, "draws = 1"), ({"rankings": {}}, "no ranking"),
                         ({"furthest": 0.0}, "furthest")):  # fmt: skip
        with pytest.raises(ConfigError, match=words) as caught:
            evaluation(**wrong)
        assert "\n" not in str(caught.value)
