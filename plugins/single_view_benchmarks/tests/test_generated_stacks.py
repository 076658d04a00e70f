"""Scenes that are made when they are asked for, and kept."""

import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError
from scenefw.core.types import Pose, Scene, SceneObject
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw_single_view_benchmarks.generated_stacks import GeneratedStacks

BOX = trimesh.creation.box((0.1, 0.1, 0.1))
UPRIGHT = np.array([1.0, 0, 0, 0])


class Source:
    """A box at the height of its attempt's number; only every `period`-th attempt succeeds."""

    def __init__(self, period=3):
        self.period, self.calls = period, 0

    def generate(self, index, seed):
        self.calls += 1
        if index % self.period != self.period - 1:
            return None
        solid = SolidMesh(np.asarray(BOX.vertices), np.asarray(BOX.faces), name="box")
        item = SceneObject(solid, Pose(np.array([0, seed, float(index)]), UPRIGHT), 0.5)
        return Scene((item,), index, seed, "test")


def heights(stacks):
    return [stacks.objects(row)[0].pose.position[2] for row in range(len(stacks))]


def test_a_scene_is_that_of_the_first_attempt_that_succeeds(tmp_path):
    stacks = GeneratedStacks(Source(), 2, 4, tmp_path)
    assert heights(stacks) == [2, 200]  # 200 attempts for each scene
    assert stacks.objects(0)[0].pose.position[1] == 4
    np.testing.assert_array_equal(stacks.indices, [0, 1])
    assert stacks.parameters([1], "cpu").positions[0, 0, 2] == 200


def test_kept_scenes_are_not_made_again_and_damaged_ones_are(tmp_path):
    first = heights(GeneratedStacks(Source(), 2, 4, tmp_path))
    source = Source()
    assert heights(GeneratedStacks(source, 2, 4, tmp_path)) == first
    assert source.calls == 0
    next(tmp_path.glob("000000*.npz")).write_bytes(b"damaged")
    assert heights(GeneratedStacks(source, 2, 4, tmp_path)) == first
    assert source.calls == 3


def test_other_settings_of_the_source_have_other_files(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert heights(GeneratedStacks(Source(2), 1)) == [1]
    assert heights(GeneratedStacks(Source(5), 1)) == [4]
    assert heights(GeneratedStacks(Source(2), 1)) == [1]


def test_scenes_that_never_come_to_rest_are_told(tmp_path):
    with pytest.raises(ConfigError, match="none of 200 attempts at scene 0"):
        GeneratedStacks(Source(1000), 1, 0, tmp_path).objects(0)
    with pytest.raises(ConfigError):
        GeneratedStacks(Source(), 0)
