"""Stacks stand still, inside the limits, without cutting into each other, and come out the same."""

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose, SceneObject
from scenefw.scenes.splits import split_of
from scenefw.shapes.superquadric import Superquadric
from scenefw_publishing.scene_checks import deepest_penetration
from scenefw_simulators.engines.pybullet_engine import PyBulletEngine
from scenefw_simulators.generation.library import SuperquadricLibrary
from scenefw_simulators.generation.stacks import StackGenerator

pytest.importorskip("pybullet", reason="needs pybullet (pip install 'scenefw[simulation]')")


def generator(**settings):
    return StackGenerator(SuperquadricLibrary(size=12), PyBulletEngine(), **settings)


@pytest.fixture(scope="module")
def scenes():
    source = generator()
    return [scene for scene in (source.generate(i, 7) for i in range(4)) if scene is not None]


def numbers(scene):
    return np.array(
        [[*o.shape.half_axes, *o.pose.position, *o.pose.quaternion, o.mass] for o in scene.objects]
    )


def test_most_attempts_succeed_with_three_or_four_objects(scenes):
    assert len(scenes) >= 3
    assert {len(scene.objects) for scene in scenes} <= {3, 4}
    assert all(scene.seed == 7 for scene in scenes)


def test_objects_lie_inside_the_limits(scenes):
    for scene in scenes:
        positions = numbers(scene)[:, 3:6]
        assert (np.abs(positions[:, :2]) <= 0.25).all()
        assert (positions[:, 2] >= 0).all()
        assert (positions[:, 2] <= 0.6).all()


def test_objects_touch_but_do_not_cut_into_each_other(scenes):
    for scene in scenes:
        assert -1e-3 < deepest_penetration(scene) < 2e-3


def test_scenes_stay_where_they_are(scenes):
    engine = PyBulletEngine()
    for scene in scenes:
        engine.reset()
        handles = [engine.add(item) for item in scene.objects]
        engine.simulate(1000)
        for item, handle in zip(scene.objects, handles, strict=True):
            assert np.linalg.norm(engine.pose(handle).position - item.pose.position) < 5e-3


def test_a_scene_depends_on_seed_and_index_alone(scenes):
    scene = scenes[-1]
    again = generator().generate(scene.index, 7)
    np.testing.assert_array_equal(numbers(again), numbers(scene))
    other = generator().generate(scene.index, 8)
    assert other is None or not np.array_equal(numbers(other), numbers(scene))


def test_scenes_are_exact_in_single_precision(scenes):
    for scene in scenes:
        np.testing.assert_array_equal(numbers(scene), numbers(scene).astype(np.float32))


def test_exactly_so_many_objects():
    source = generator(minimum=2, maximum=2)
    found = [scene for scene in (source.generate(i, 0) for i in range(3)) if scene is not None]
    assert found
    assert all(len(scene.objects) == 2 for scene in found)


class Balls:
    """An engine in which every object ends far away, so that no scene comes about."""

    def __init__(self):
        self.added = 0

    def reset(self):
        pass

    def add(self, item):
        self.added += 1
        return self.added

    def remove(self, handle):
        pass

    def overlaps(self, handle):
        return False

    def settle(self, max_steps):
        return True

    def pose(self, handle):
        return Pose(np.array([1.0, 0, 0]), np.array([1.0, 0, 0, 0]))


def test_an_attempt_gives_up_after_its_trials():
    engine = Balls()
    source = StackGenerator(SuperquadricLibrary(size=3), engine, minimum=2, maximum=2, trials=5)
    assert source.generate(0, 0) is None
    assert engine.added == 10


class Sliding(Balls):
    """An engine in which every object creeps on for ever."""

    def __init__(self):
        super().__init__()
        self.x = 0.0

    def simulate(self, steps):
        self.x += 1e-3

    def pose(self, handle):
        return Pose(np.array([self.x, 0, 0.1]), np.array([1.0, 0, 0, 0]))


def test_a_creeping_scene_is_given_up():
    source = StackGenerator(SuperquadricLibrary(size=3), Sliding(), minimum=1, maximum=1, checks=3)
    assert source.generate(0, 0) is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"minimum": 5}, "maximum = .*: expected 5 or more"),
        ({"minimum": 0}, "minimum = 0"),
        ({"upper": (0.25, 0.25, -1)}, r"scene\.upper"),
    ],
)
def test_bad_settings(wrong, said):
    with pytest.raises(ConfigError, match=said):
        generator(**wrong)


def test_scene_objects_carry_uniform_density(scenes):
    for scene in scenes:
        item: SceneObject
        for item in scene.objects:
            assert item.mass == pytest.approx(500 * item.shape.volume(), rel=1e-6)


class Parts:
    """A part has one shape, whose size says which part it is."""

    SIZES = {"train": 0.05, "val": 0.06, "test": 0.07, "final": 0.08}  # noqa: RUF012

    def sample(self, rng, split):
        return Superquadric(np.full(3, self.SIZES[split]), np.full(3, 8.0))


@pytest.mark.parametrize("split", [None, "final"])
def test_scenes_have_shapes_of_their_part_alone(split):
    source = StackGenerator(Parts(), PyBulletEngine(), 1, 1, split=split)
    made = [scene for scene in (source.generate(i, 0) for i in range(12)) if scene is not None]
    assert {scene.split for scene in made} == ({"final"} if split else {"train", "val", "test"})
    for scene in made:
        assert scene.split == (split or split_of(0, scene.index))
        assert all(o.shape.half_axes[0] == Parts.SIZES[scene.split] for o in scene.objects)


def test_an_unknown_part_is_refused():
    with pytest.raises(ConfigError, match=r"scene\.split = last"):
        generator(split="last")
