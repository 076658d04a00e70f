"""Procedural models: sizes, validity, variety, determinism, splits."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw.core.tabletop import COMPARISON, SMALL_OBJECTS, TEXTURE
from scenefw_tabletops.shapes.tabletop.library import FAMILIES, ProceduralModels, split_instances

LENGTHS = {  # longest side (m), least and greatest
    "remote_control": (0.12, 0.23),
    "keyboard": (0.25, 0.46),
    "model_plane": (0.12, 0.33),
    "coin": (0.017, 0.033),
    "cable": (0.06, 0.30),
    "pen": (0.12, 0.18),
    "brick": (0.015, 0.07),
    "paperclip": (0.03, 0.065),
    "book": (0.11, 0.225),
}
MODELS = {name: ProceduralModels(("surface", name)) for name in FAMILIES}


@given(st.sampled_from(sorted(FAMILIES)), st.integers(0, 65))
def test_a_model_is_whole_and_as_large_as_the_thing(name, instance):
    model = MODELS[name].model(1, instance)
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    least, greatest = LENGTHS[name]
    assert least <= (high - low)[:2].max() <= greatest
    assert 0.001 < high[2] < 0.15
    assert low[2] == pytest.approx(0, abs=1e-12)
    assert np.allclose((low + high)[:2], 0, atol=1e-9)
    count = len(model.faces)
    assert model.faces.min() >= 0
    assert model.faces.max() < len(model.vertices)
    assert model.normals.shape == (count, 3, 3)
    assert np.allclose(np.linalg.norm(model.normals, axis=-1), 1, atol=1e-3)
    assert model.colours.shape == (count, 3)
    assert model.colours.min() >= 0
    assert model.colours.max() <= 1
    assert model.textures.shape[1] == TEXTURE
    assert set(np.unique(model.texture_of)) == set(range(len(model.textures)))
    assert (model.textures[:, 1] > 0).all()


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_faces_point_outwards(name):
    """Closed parts with outward faces enclose positive volumes, some inside others."""
    model = MODELS[name].model(1, 3)
    a, b, c = np.moveaxis(model.vertices[model.faces], 1, 0)
    volume = (a * np.cross(b, c)).sum() / 6
    size = np.ptp(model.vertices, axis=0)
    assert 0.01 * size.prod() < volume < 2.5 * size.prod()


@pytest.mark.parametrize("name", sorted(FAMILIES))
def test_instances_differ_and_repeat(name):
    first, again = ProceduralModels(("surface", name)), ProceduralModels(("surface", name))
    sizes = {tuple(np.ptp(first.model(1, i).vertices, axis=0).round(5)) for i in range(8)}
    assert len(sizes) >= 5  # bricks come in few sizes, like those in shops
    assert np.array_equal(first.model(1, 5).vertices, again.model(1, 5).vertices)
    assert np.array_equal(first.model(1, 5).textures, again.model(1, 5).textures)
    other = ProceduralModels(("surface", name), seed=1).model(1, 5)
    assert not np.array_equal(first.model(1, 5).colours[:1], other.colours[:1])


@given(st.integers(3, 400))
def test_splits_share_no_instance(count):
    parts = split_instances(count)
    together = [i for numbers in parts.values() for i in numbers]
    assert sorted(together) == list(range(count))
    assert min(map(len, parts.values())) >= 1


def test_the_thesis_splits_66():
    assert [len(part) for part in split_instances(66).values()] == [49, 7, 10]


def test_sets_of_classes():
    assert ProceduralModels("comparison").classes == COMPARISON
    assert ProceduralModels("small_objects").classes == SMALL_OBJECTS


@pytest.mark.parametrize("classes", ["comparisons", ["pen"], ["surface", "teapot"], ["surface"]])
def test_unknown_classes_are_named(classes):
    with pytest.raises(ConfigError, match="unknown; give comparison or small_objects"):
        ProceduralModels(classes)


def test_too_few_instances_and_unknown_splits():
    with pytest.raises(ConfigError, match="2 models of a class can't be split"):
        ProceduralModels(count=2)
    with pytest.raises(ConfigError, match="split 'testing' is unknown"):
        ProceduralModels().instances(1, "testing")
