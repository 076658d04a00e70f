"""Stability of piles: true scenes stand, raised ones fall as far as they were raised."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from scenefw.core.batches import Completion
from scenefw.core.types import GridSpec, PlacedShape, Pose, SceneObject
from scenefw.data.batches.stacks import StackScenes, shipped_scenes
from scenefw.evaluation.kept_rows import KeptRows
from scenefw.evaluation.statistics import median_interval
from scenefw.mapping.projective import Projective
from scenefw.renderers.sphere_tracer import SphereTracer
from scenefw.representations.volumes import scene_volumes
from scenefw.scenes.cameras import RandomViewpoints
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.motions import motions
from scenefw_single_view_benchmarks.report.stability import stability_table
from scenefw_single_view_benchmarks.stability import StabilityEvaluation
from scenefw_single_view_benchmarks.stability_results import Pile

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")
pytestmark = pytest.mark.skipif(not shipped_scenes().exists(), reason="no shipped data set")

GRID = GridSpec(resolution=40)
RAISED = 0.1  # m


class Knowing:
    """Knows the first scene, shows it raised, as shapes or as volumes alone."""

    grid = GRID

    def __init__(self, scenes, raised=0.0, *, shapes=True):
        self.metadata = {}
        one = scenes.parameters([0])
        self.parameters = replace(one, positions=one.positions + torch.tensor([0, 0, raised]))
        self.items = scenes.objects(0) if shapes else ()
        self.raised = raised

    def complete(self, partial, grid, samples, generator):
        volumes = scene_volumes(self.parameters, grid)
        up = np.array([0, 0, self.raised])
        placed = {
            i: PlacedShape(item.shape, Pose(item.pose.position + up, item.pose.quaternion))
            for i, item in enumerate(self.items, start=1)
        }
        one = Completion(volumes.tsdf[:, 0], volumes.instances, placed=(placed,) if placed else ())
        return [one] * samples


@pytest.fixture(scope="module")
def result():
    scenes = StackScenes(split="val", limit=1)
    methods = {
        "shapes": Knowing(scenes),
        "raised": Knowing(scenes, RAISED),
        "meshes": Knowing(scenes, shapes=False),
        "absent": None,
    }
    return StabilityEvaluation(
        scenes, methods, RandomViewpoints(width=80, height=60), SphereTracer(), Projective(),
        PyBulletEngine(gravity=10.0), views=1, samples=2, steps=1000,
    ).run()  # fmt: skip


def test_true_scenes_stand_as_shapes_and_as_meshes(result):
    assert result.methods == ("truth", "shapes", "raised", "meshes")
    figures = result.figures
    assert figures["truth/displacement"] < 0.003
    assert figures["shapes/displacement"] == pytest.approx(figures["truth/displacement"], abs=1e-4)
    assert figures["meshes/displacement"] < 0.03
    assert [figures[f"{name}/stable"] for name in ("truth", "shapes", "meshes")] == [1, 1, 1]
    assert figures["meshes/objects"] == figures["truth/objects"]
    assert len(result.views[0].piles["shapes"]) == 1  # two equal samples count once


def test_what_floats_falls_to_where_it_was(result):
    assert result.figures["raised/displacement"] == pytest.approx(RAISED, abs=0.02)


def test_table_says_what_was_done(result):
    table = stability_table(result)
    assert "1000 steps" in table.note
    assert [name for name, _ in table.rows][:2] == ["true scenes", "shapes"]
    assert table.rows[0][1][4] == pytest.approx(100)  # per cent of stable piles


def test_an_interrupted_evaluation_goes_on_where_it_was(tmp_path):
    scenes = StackScenes(split="val", limit=1)

    def run(methods, kept):
        return StabilityEvaluation(
            scenes, methods, RandomViewpoints(width=80, height=60), SphereTracer(), Projective(),
            PyBulletEngine(), views=2, samples=1, steps=50, kept=kept,
        ).run()  # fmt: skip

    class Stopped(Knowing):
        calls = 0

        def complete(self, partial, grid, samples, generator):
            self.calls += 1
            if self.calls == 2:
                raise KeyboardInterrupt
            return super().complete(partial, grid, samples, generator)

    with pytest.raises(KeyboardInterrupt):
        run({"shapes": Stopped(scenes)}, KeptRows(tmp_path))
    result = run({"shapes": Knowing(scenes)}, KeptRows(tmp_path))
    assert result == run({"shapes": Knowing(scenes)}, None)


def test_objects_that_move_or_turn_far_make_a_pile_unstable():
    def stable(*rows):
        shifts, turns = zip(*rows, strict=True)
        return Pile(shifts, turns).scores(0.2, 30.0)["stable"]

    assert stable((0.19, 29.0), (0.0, 0.0)) == 1
    assert stable((0.19, 29.0), (0.21, 0.0)) == 0
    assert stable((0.0, 31.0), (0.0, 0.0)) == 0
    empty = Pile((), ()).scores(0.2, 30.0)
    assert empty["stable"] == 0
    assert np.isnan(empty["displacement"])


def test_a_motion_is_measured_from_start_to_end():
    turned = np.array([np.cos(np.pi / 8), 0, np.sin(np.pi / 8), 0])  # 45 degrees about y
    brick = SceneObject(Superquadric([0.1, 0.1, 0.02], [60] * 3), Pose(np.zeros(3), turned), 0.4)
    high = replace(brick, pose=Pose(np.array([0, 0, 0.3]), turned))
    (one,) = motions([high], PyBulletEngine(), 2000, until_rest=True)
    assert one.turn == pytest.approx(45, abs=1)
    assert one.pose.position[2] == pytest.approx(0.02, abs=1e-3)
    assert one.shift == pytest.approx(np.linalg.norm(one.pose.position - high.pose.position))


def test_bounds_of_a_median_are_those_of_whole_scenes():
    rng = np.random.default_rng(1)
    values = rng.normal(size=200)
    found = median_interval(values, range(200))
    drawn = np.median(rng.choice(values, size=(4000, 200)), axis=1)
    assert found.mean == np.median(values)
    expected = np.quantile(drawn, [0.025, 0.975])
    np.testing.assert_allclose([found.low, found.high], expected, atol=0.04)
    assert median_interval([1.0, 2.0, np.nan], [0, 0, 1]).count == 1
