"""Choices of grasps and their scores; a method that knows the truth does as it predicts."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from plugins.grasping.tests.boxes import grasping
from plugins.single_view_benchmarks.tests.test_stability import Knowing

from scenefw.core.errors import ConfigError
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.scenes.cameras import RandomViewpoints
from scenefw_grasping.choices import OF_A_SCENE, Tried, score
from scenefw_grasping.evaluation import GraspingEvaluation, stands_for
from scenefw_grasping.report import films
from scenefw_grasping.report.sections import grasping_sections, grasping_table
from scenefw_grasping.results import ANY, GIVEN, GraspingResult, SceneGrasps

LOW = Tried(1, 0, 0.10, 2, 0.6, False, True, 0.000, 0.030, 0.060)
TOP = Tried(2, 1, 0.30, 1, 0.7, False, True, 0.002, 0.001, 0.002)
FREE = Tried(3, 2, 0.10, 0, 0.9, True, True, 0.003, 0.004, 0.020)
LOST = Tried(2, 3, 0.30, 1, 0.8, False, True, 0.004, 0.000, 0.000, "the cup lost it")
TRIES = (LOW, TOP, FREE, LOST)


def test_each_choice_takes_what_it_looks_at():
    chosen = {name: choice(TRIES) for name, choice in OF_A_SCENE.items() if choice}
    assert chosen == {
        "chosen": LOW, "topmost": LOST, "least_neighbours": FREE, "best_seal": LOST, "oracle": TOP
    }  # fmt: skip


def test_scores_are_those_of_the_true_scene():
    assert LOW.scores(0.01).tolist() == [0.03, 0, 0]
    assert TOP.scores(0.01).tolist() == [0.001, 0, 1]
    assert LOST.scores(0.01).tolist() == [0, 1, 0]
    np.testing.assert_allclose(score(None, TRIES, 0.01), (0.035 / 4, 0.25, 0.25))
    np.testing.assert_allclose(score(None, TRIES, 0.03), (0.035 / 4, 0.25, 0.5))


def test_a_result_sums_up_scenes_and_objects():
    other = replace(TOP, disturbance=0.003)
    scenes = (
        SceneGrasps(7, TRIES),
        SceneGrasps(8, (other,)),
        SceneGrasps(9, (), ("too heavy: 5",)),
    )
    result = GraspingResult(scenes, 0.01)
    assert len(result.groups[ANY]) == 2
    assert [(scene, len(tries)) for scene, tries in result.groups[GIVEN]] == [(7, 2)]
    figures = result.figures
    assert figures["any/chosen/disturbance"] == pytest.approx((0.03 + 0.003) / 2)
    assert figures["any/oracle/clean"] == 1
    assert figures["given/chosen/failed"] == 0  # the better of object 2
    assert figures["given/mean/failed"] == 0.5
    assert (figures["scenes"], figures["without"]) == (3, 1)
    assert result.gain(ANY, "oracle", "disturbance").mean == pytest.approx(0.029 / 2)
    assert result.failures(ANY, "topmost") == {"the cup lost it": 1}
    assert result.reasons == {"too heavy": 1}
    assert (
        set(figures) - {f"{n}{e}" for n in result.measures for e in ("", "_low", "_high")} == set()
    )
    table = grasping_table(result, ANY)
    assert "2 scenes, 5 grasps" in table.note
    assert table.rows[0][1][0] == pytest.approx(16.5)


def test_labels_stand_for_the_object_that_they_overlap_most():
    true, predicted = np.zeros((2, 4, 4, 4), dtype=np.int32)
    true[:2], true[2:, :2] = 1, 2
    predicted[:2], predicted[2:, :2], predicted[3, 3] = 5, 1, 4
    assert stands_for(predicted, true) == {1: 2, 4: 0, 5: 1}


@pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")
@pytest.mark.exhaustive
def test_who_knows_the_truth_does_as_predicted(tmp_path, monkeypatch):
    monkeypatch.setattr(films, "_SIZE", (66, 54))
    pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
    scenes = StackScenes(split="val", limit=1)
    result = GraspingEvaluation(
        scenes, Knowing(scenes), RandomViewpoints(width=80, height=60), SphereTracer(),
        Projective(), grasping(hidden=True), examples=1,
    ).run()  # fmt: skip
    ((scene, tries),) = result.groups[ANY]
    assert scene == scenes.indices[0]
    assert len(tries) > 1
    for one in tries:
        if one.lifted:
            assert one.disturbance == pytest.approx(one.predicted, abs=3e-3)
    assert min(tries, key=lambda one: one.rank).lifted
    sections = grasping_sections(result, tmp_path)
    (picture,) = sections[-1].blocks
    with Image.open(tmp_path / picture.links[0][1]) as film:
        assert film.n_frames > 5
    assert (tmp_path / picture.path).is_file()


def test_a_method_without_a_grid_needs_one():
    knowing = type("Any", (), {"grid": None})()
    with pytest.raises(ConfigError, match="no grid"):
        GraspingEvaluation((), knowing, None, None, None, None)
