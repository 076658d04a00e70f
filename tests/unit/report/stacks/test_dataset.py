"""Stacks are drawn, and scenes made anew are compared with the stored ones."""

from dataclasses import replace

import numpy as np
import pytest

from scenefw.core.errors import MissingDependencyError
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.data.batches.stacks import StackScenes
from scenefw.report.stacks.dataset import Stacks
from scenefw.scenes.storage import pack, save_scenes
from scenefw.shapes.superquadric import Superquadric


def _scene(index):
    rng = np.random.default_rng(index)
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    objects = tuple(
        SceneObject(
            Superquadric(np.full(3, 0.05), np.full(3, 4.0)),
            Pose(np.array([0.15 * i - 0.15, rng.uniform(-0.1, 0.1), 0.05]), upright),
            1.0,
        )
        for i in range(3)
    )
    return Scene(objects, index, 0)


class _Source:
    def __init__(self, shift=0.0):
        self.shift = shift

    def generate(self, index, seed):
        scene = _scene(index)
        first = scene.objects[0]
        moved = Pose(first.pose.position + self.shift * np.eye(3)[0], first.pose.quaternion)
        return replace(scene, objects=(replace(first, pose=moved), *scene.objects[1:]))


@pytest.fixture
def scenes(tmp_path):
    path = tmp_path / "stacks.npz"
    save_scenes(path, pack([_scene(i) for i in (3, 5, 8)]), {"seed": 0})
    return StackScenes(path, "all")


@pytest.mark.parametrize("shift", [0.0, 0.004])
def test_scenes_made_anew_are_measured_against_the_stored_ones(scenes, tmp_path, shift):
    (section,), figures = Stacks(scenes, _Source(shift), tmp_path, shown=2, simulated=2).show()
    assert figures["stacks/scenes"] == 3
    assert figures["stacks/simulated"] == 2
    assert figures["stacks/apart"] == pytest.approx(shift, abs=1e-6)
    words, picture = section.blocks
    assert "2 came out as stored" in words.text
    assert (tmp_path / picture.path).is_file()


def test_without_a_simulator_the_page_says_so(scenes, tmp_path):
    class _Missing:
        def generate(self, index, seed):
            raise MissingDependencyError("pip install pybullet")

    (section,), figures = Stacks(scenes, _Missing(), tmp_path, shown=1).show()
    assert "pip install pybullet" in section.blocks[0].text
    assert "stacks/apart" not in figures


@pytest.mark.parametrize("source", [_Source(0.1), None])
def test_scenes_that_come_out_otherwise_are_counted(scenes, tmp_path, source):
    class _Failing:
        def generate(self, index, seed):
            return None

    (section,), figures = Stacks(
        scenes, source or _Failing(), tmp_path, shown=1, simulated=2
    ).show()
    assert "0 came out as stored" in section.blocks[0].text
    assert figures["stacks/same"] == 0
    assert "stacks/apart" not in figures
