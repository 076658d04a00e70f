"""How sure methods are of objects, with methods that are as sure as they are told to be."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats
from tests.unit.perception.estimate.test_plausibility import BOX, OTHER, solid
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import rigid
from scenefw.core.types import GridSpec, Pose, SceneEstimate
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.perception.estimate.shape_cues import CUES
from scenefw.postprocessing.confidence import ExpectedOverlap
from scenefw.report.presentation import Chapter
from scenefw_annotated_views.annotations import AnnotatedObject, AnnotatedView, Silhouette
from scenefw_single_view_benchmarks import confidence_results
from scenefw_single_view_benchmarks.confidence import ConfidenceEvaluation
from scenefw_single_view_benchmarks.confidence_results import ConfidenceResult, ObjectConfidence

UPRIGHT = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """Bounds of ranks and groups from 50 resamples; 1000 take a quarter of a second each."""
    monkeypatch.setattr(confidence_results, "_RESAMPLES", 50)


class TwoBoxes:
    """One view of two boxes; the floor's frame is 1 m off, as an estimate may place it anywhere."""

    split, categories = "val", ("box",)

    def __init__(self, unknown=False):
        self.frame = frame_of(camera_at(eye=(0.1, -0.8, 0.6), size=(160, 120)), (BOX, OTHER))
        self.unknown = self.frame.labels == 2 if unknown else None

    def __len__(self):
        return 2

    def views(self, scene, count):
        camera = camera_at(eye=(0.1, -0.8, 0.6), size=(160, 120))
        boxes = [solid(box.lower, box.upper) for box in (BOX, OTHER)]
        objects = tuple(AnnotatedObject(i, mesh, UPRIGHT, 0) for i, mesh in enumerate(boxes))
        masks = [self.frame.labels == label for label in (1, 2)]
        silhouettes = tuple(Silhouette(mask, mask, int(mask.sum()), None) for mask in masks)
        yield AnnotatedView(replace(self.frame, camera=camera), objects, silhouettes, self.unknown)


class Halves:
    """Finds the first box as it is, and the lower half of the second one."""

    samples, calibration = 3, None

    def __init__(self):
        self.masks = []

    def observe(self, frame, mask):
        self.masks.append(mask)
        return frame

    def reconstruct(self, frame, *, first_only):
        shift = np.array([1.0, 0.0, 0.0])
        half = (*OTHER.upper[:2], OTHER.upper[2] / 2)
        meshes = {
            1: solid(np.add(BOX.lower, shift), np.add(BOX.upper, shift)),
            2: solid(np.add(OTHER.lower, shift), np.add(half, shift)),
        }
        camera = replace(
            frame.camera, T_world_camera=rigid(np.eye(3), shift) @ frame.camera.T_world_camera
        )
        grid = GridSpec(resolution=8)
        objects = tuple(
            replace(item, cues=dict.fromkeys(CUES, 0.5))
            for item in estimate_objects(meshes, {1: 0.9, 2: 0.4})
        )
        empty = np.zeros(grid.shape, np.float32)
        labels = frame_of(camera_at(eye=(0.1, -0.8, 0.6), size=(160, 120)), (BOX, OTHER)).labels
        return [
            SceneEstimate(
                objects, grid, empty, empty.astype(np.int32), replace(frame, camera=camera),
                masks=labels,
            )
        ]  # fmt: skip


def evaluation(method=None, **settings):
    return ConfidenceEvaluation(
        {"boxes": TwoBoxes()}, method or Halves(), **({"workers": 1} | settings)
    )


def test_objects_have_the_iou_of_their_solids_wherever_the_floor_is(tmp_path):
    method = Halves()
    result = evaluation(method).run()
    assert [item.iou for item in result.objects] == pytest.approx([1.0, 0.5] * 4, abs=0.02)
    assert [item.confidence for item in result.objects] == [0.9, 0.4] * 4
    assert [item.marked for item in result.objects] == [False, False, True, True] * 2
    assert [mask is None for mask in method.masks] == [True, False] * 2
    assert np.unique(method.masks[1]).tolist() == [0, 1, 2]
    (tmp_path / "config.yaml").write_text("a: 1\n")
    (tmp_path / "run.json").write_text("{}")
    first = evaluation(kept=KeptRows(tmp_path), output=tmp_path).run()
    again = evaluation(kept=KeptRows(tmp_path)).run()
    assert first.objects == again.objects == result.objects
    written = ExpectedOverlap.of(json.loads((tmp_path / "calibration.json").read_text()))
    assert written.names == tuple(CUES)
    assert written([[0.5] * len(CUES)]) == pytest.approx([0.75], abs=0.02)


def test_what_nobody_knows_counts_for_nothing():
    families = {"boxes": None}
    result = ConfidenceEvaluation(
        families, Halves(), validation={"posed": TwoBoxes(unknown=True)}, workers=1
    ).run()
    assert [item.iou for item in result.objects] == pytest.approx([1.0] * 4, abs=0.02)
    assert result.fitted is None
    (section,) = Chapter("scenefw_single_view_benchmarks.report").sections(result, None)
    assert "posed (nothing fitted)" in [name for name, _ in section.blocks[0].rows]


def test_images_of_no_use_have_no_objects():
    class Refusing(Halves):
        def observe(self, frame, mask):
            raise InputError("no floor")

    assert evaluation(Refusing()).run().objects == ()


def test_what_needs_samples_and_images_says_so():
    with pytest.raises(ConfigError, match=r"reconstructor\.samples is 1"):
        evaluation(SimpleNamespace(samples=1, calibration=None))
    with pytest.raises(ConfigError, match="families"):
        ConfidenceEvaluation({"boxes": None}, Halves())


def objects(count=400, family="stacks", seed=0, offset=0.0):
    """Their IoU rises with the square of the agreement; another cue says nothing."""
    random = np.random.default_rng(seed)
    rows = []
    for i in range(count):
        agreement, other = random.uniform(0, 1, 2)
        iou = float(np.clip(0.2 + 0.6 * agreement + random.normal(0, 0.05) + offset, 0, 1))
        cues = dict.fromkeys(CUES, 0.5) | {"agreement": agreement, "fill": other}
        rows.append(ObjectConfidence(family, i // 4, i % 2 == 0, iou, 0.2 + 0.6 * agreement, cues))
    return tuple(rows)


def test_too_sure_methods_have_a_bias_that_a_fit_takes_away():
    sure = tuple(replace(item, confidence=min(1.0, item.iou + 0.1)) for item in objects())
    figures = ConfidenceResult(sure, 3).figures
    assert (figures["objects"], figures["images"]) == (400, 100)
    assert figures["confidence/bias"] == pytest.approx(0.1, abs=0.01)
    assert abs(figures["fitted/bias"]) < 0.02
    assert figures["fitted/error"] == pytest.approx(0.05, abs=0.02)
    assert figures["fitted/gap"] < 0.03 < figures["confidence/gap"]
    assert figures["fitted/skill"] > 0.9
    assert figures["constant/skill"] == 0
    assert figures["fitted/rank"] > 0.9
    low, high = figures["fitted/rank_low"], figures["fitted/rank_high"]
    assert low < figures["fitted/rank"] < high


def test_ranks_are_those_of_scipy():
    result = ConfidenceResult(objects(40), 3)
    rows = result.rows_of("stacks")
    expected = [item.cues["agreement"] for item in result.objects]
    rank = stats.spearmanr(expected, result.iou).statistic
    assert result.score("agreement", "rank", rows).mean == pytest.approx(rank)


def test_nothing_is_fitted_to_validation_families():
    fit, validation = objects(), objects(40, "posed", 1, offset=0.2)
    both = ConfidenceResult(fit + validation, 3, frozenset({"posed"}))
    alone = ConfidenceResult(fit, 3)
    np.testing.assert_array_equal(both.fitted.weights, alone.fitted.weights)
    assert both.figures["posed/fitted/bias"] == pytest.approx(-0.2, abs=0.03)
    assert both.figures["posed/objects"] == 40
    assert both.figures["objects"] == 400
    np.testing.assert_array_equal(both.expected["fitted"][:400], alone.expected["fitted"])


def test_the_page_shows_families_and_what_was_fitted():
    result = ConfidenceResult(objects() + objects(40, "random", 1), 3)
    (section,) = Chapter("scenefw_single_view_benchmarks.report").sections(result, None)
    scores, families, groups, fit = section.blocks
    assert [name for name, _ in scores.rows] == [
        "agreement of hypotheses", "confidence of run=predict",
        "fitted to the other half of the scenes", "mean IoU of the other half (no learning)",
    ]  # fmt: skip
    assert [name for name, _ in families.rows] == ["stacks", "random"]
    assert len(groups.rows) == 8
    assert sum(cells[0] for _, cells in groups.rows) == 440
    assert "agreement +" in fit.text
    assert set(result.figures) <= {
        *result.measures, *(f"{n}{end}" for n in result.measures for end in ("_low", "_high")),
    }  # fmt: skip


def test_without_objects_the_page_says_so():
    (section,) = Chapter("scenefw_single_view_benchmarks.report").sections(
        ConfidenceResult((), 3), None
    )
    assert "No object" in section.blocks[0].text
    assert ConfidenceResult((), 3).figures == {"objects": 0, "images": 0}
