"""Families of meshes by part of the data."""

import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError, InputError
from scenefw_single_view_benchmarks.mesh_families import MeshFamilies


@pytest.fixture
def root(tmp_path):
    for family, side in (("cups", 0.05), ("books", 0.07), ("tools", 0.09)):
        (tmp_path / family).mkdir()
        for number in range(2):
            mesh = trimesh.creation.box((side, side, side + 0.01 * number))
            mesh.export(tmp_path / family / f"{number}.ply")
    return str(tmp_path)


def names(shapes, split):
    rng = np.random.default_rng(0)
    return {shapes.sample(rng, split).name for _ in range(40)}


def test_each_part_has_the_things_of_its_families_alone(root):
    shapes = MeshFamilies(root, {"val": ["cups"], "test": ["books", "tools"]}, leave_out="tools/1")
    assert names(shapes, "val") == {"cups/0", "cups/1"}
    assert names(shapes, "test") == {"books/0", "books/1", "tools/0"}


def test_what_is_missing_is_said(root):
    with pytest.raises(ConfigError, match="input=FOLDER that holds the families cups, pots"):
        MeshFamilies(None, {"val": ["pots"], "test": ["cups"]})
    with pytest.raises(ConfigError, match="cups belong to two parts"):
        MeshFamilies(root, {"val": ["cups"], "test": ["cups"]})
    shapes = MeshFamilies(root, {"val": ["pots"], "test": ["cups"]})
    with pytest.raises(ConfigError, match="part train has no family"):
        shapes.sample(np.random.default_rng(0), "train")
    with pytest.raises(InputError, match="no folder pots"):
        shapes.sample(np.random.default_rng(0), "val")
