"""How sure methods are of objects, with methods that are as sure as they are told to be."""

import numpy as np
import pytest
import torch

from scenefw.core.batches import Completion
from scenefw.core.errors import ConfigError
from scenefw.core.types import GridSpec
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.stacks.confidence import ConfidenceEvaluation
from scenefw.evaluation.stacks.confidence_results import ConfidenceResult, ObjectConfidence
from scenefw.mapping.projective import Projective
from scenefw.postprocessing.confidence import Calibration
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.report.presentation import Chapter
from scenefw.scenes.cameras import RandomViewpoints

GRID = GridSpec(resolution=24)


class Blocks:
    """Two blocks; in further samples the second one is of half the size."""

    grid = GRID
    calibration = None

    def complete(self, partial, grid, samples, generator):
        found = []
        for number in range(samples):
            labels = torch.zeros((1, *grid.shape), dtype=torch.int32)
            labels[:, 2:6, 2:6, 2:6] = 1
            labels[:, 12:16, 2:6, 2 : (6 if number == 0 else 4)] = 2
            found.append(Completion(torch.where(labels > 0, -0.01, 0.01), labels))
        return found


def evaluation(**settings):
    settings = {"samples": 3, "workers": 1} | settings
    return ConfidenceEvaluation(
        StackScenes(split="val", limit=2), Blocks(), RandomViewpoints(width=80, height=60),
        SphereTracer(), Projective(), **settings,
    )  # fmt: skip


@pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")
def test_objects_are_as_sure_as_samples_are_alike(tmp_path):
    result = evaluation().run()
    assert result.agreement.tolist() == pytest.approx([1.0, 0.5] * 2)
    assert len(set(result.scenes.tolist())) == 2
    (tmp_path / "config.yaml").write_text("a: 1\n")
    (tmp_path / "run.json").write_text("{}")
    first = evaluation(kept=KeptRows(tmp_path)).run()
    again = evaluation(kept=KeptRows(tmp_path)).run()
    assert first.objects == again.objects == result.objects


def test_what_needs_samples_and_a_grid_says_so():
    with pytest.raises(ConfigError, match=r"size\.samples is 1"):
        evaluation(samples=1)

    class Gridless(Blocks):
        grid = None

    with pytest.raises(ConfigError, match="no grid"):
        ConfidenceEvaluation(
            StackScenes(split="val", limit=1), Gridless(), RandomViewpoints(), SphereTracer(),
            Projective(),
        )  # fmt: skip


def objects(count=400, curve=np.square, seed=0):
    random = np.random.default_rng(seed)
    said = random.uniform(0, 1, count)
    iou = (curve(said) + random.normal(0, 0.05, count)).clip(0, 1)
    return tuple(
        ObjectConfidence(i // 4, float(s), float(t))
        for i, (s, t) in enumerate(zip(said, iou, strict=True))
    )


def test_too_sure_methods_have_a_bias_that_calibration_takes_away():
    squared = Calibration(np.linspace(0, 1, 21).tolist(), (np.linspace(0, 1, 21) ** 2).tolist())
    figures = ConfidenceResult(objects(), 3, squared).figures
    assert figures["objects"] == 400
    assert figures["scenes"] == 100
    assert figures["said/bias"] == pytest.approx(1 / 2 - 1 / 3, abs=0.03)
    for way in ("shipped", "fitted"):
        assert abs(figures[f"{way}/bias"]) < 0.02
        assert figures[f"{way}/error"] == pytest.approx(0.05, abs=0.02)
        assert figures[f"{way}/skill"] > 0.9 > figures["said/skill"]
    assert figures["constant/skill"] == 0
    assert figures["rank"] > 0.9
    assert figures["said/skill_low"] < figures["said/skill"] < figures["said/skill_high"]


def test_the_page_says_what_to_fit():
    result = ConfidenceResult(objects(), 3)
    (section,) = Chapter("scenefw.report.stacks").sections(result, None)
    scores, bins, knots = section.blocks
    assert [name for name, _ in scores.rows] == [
        "agreement as it is", "calibrated on the other half of the scenes",
        "mean IoU of the other half (no learning)",
    ]  # fmt: skip
    assert len(bins.rows) == 8
    assert sum(cells[0] for _, cells in bins.rows) == 400
    assert knots.text.startswith("Fitted to all of them: said [")
    assert set(result.figures) <= {
        *result.measures, *(f"{n}{end}" for n in result.measures for end in ("_low", "_high")),
    }  # fmt: skip


def test_without_objects_the_page_says_so():
    (section,) = Chapter("scenefw.report.stacks").sections(ConfidenceResult((), 3), None)
    assert "No object" in section.blocks[0].text
    assert ConfidenceResult((), 3).figures == {"objects": 0, "scenes": 0}
