"""Placement of models: nothing overlaps or sticks out, scenes depend on their numbers alone."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

from scenefw.core.errors import ConfigError
from scenefw_tabletops.scenes.tabletop import TabletopGenerator, are_separate, outline_of
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

MODELS = ProceduralModels()
SMALL = ProceduralModels("small_objects")
GENERATORS = [TabletopGenerator(MODELS), TabletopGenerator(SMALL, minimum=24, maximum=40)]


def world_outlines(generator, scene):
    """Corners of items seen from above, from the triangles that are rendered."""
    geometry = generator.geometry(scene)
    return [
        outline_of(geometry.corners[geometry.item_of == i].reshape(-1, 3))
        for i in range(len(scene.items))
    ]


def overlap(first, second):
    """Whether two convex polygons share a point, as a linear programme of convex combinations."""
    both = np.concatenate([first, -second])
    equal = np.column_stack([both, [1] * len(first) + [0] * len(second),
                             [0] * len(first) + [1] * len(second)]).T  # fmt: skip
    found = linprog(np.zeros(len(both)), A_eq=equal, b_eq=[0, 0, 1, 1], method="highs")
    return found.status == 0


@pytest.mark.parametrize("generator", GENERATORS, ids=["comparison", "small"])
def test_nothing_overlaps_or_sticks_out(generator):
    scene = generator.generate(640, 0)
    outlines = world_outlines(generator, scene)
    assert len(outlines) >= 0.6 * generator.minimum
    for i, first in enumerate(outlines):
        assert np.abs(first).max() <= 0.512
        for second in outlines[:i]:
            assert not overlap(first, second)


def test_apart_measures_the_gap():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    assert are_separate(square, square + [1.1, 0.5], 0.09)
    assert not are_separate(square, square + [1.1, 0.5], 0.11)
    assert not are_separate(square, square + [0.9, 0.9], 0.0)
    diamond = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]]) * 0.5
    assert are_separate(square, diamond + [1.4, 1.4], 0.1)


def test_a_scene_depends_on_seed_and_index_alone():
    first, second = TabletopGenerator(MODELS), TabletopGenerator(ProceduralModels())
    second.generate(7, 0)
    assert first.generate(3, 0) == second.generate(3, 0)
    assert first.generate(3, 0) != first.generate(3, 1)
    assert first.generate(3, 0) != first.generate(4, 0)


@pytest.mark.parametrize(("split", "index"), [("train", 0), ("validation", 500), ("test", 646)])
def test_models_of_a_split_lie_in_its_scenes_alone(split, index):
    generator = GENERATORS[0]
    assert index in generator.numbers(split)
    for item in generator.generate(index, 0).items:
        assert item.instance in MODELS.instances(item.label, split)


def test_classes_and_places_are_uniform():
    items = [i for n in range(60) for i in GENERATORS[0].generate(n, 0).items]
    labels = np.bincount([item.label for item in items])[1:]
    assert labels.min() > 0.2 * len(items)
    places = np.array([[item.x, item.y] for item in items])
    assert np.abs(places.mean(axis=0)).max() < 0.05
    assert places.std(axis=0).min() > 0.22
    assert abs(np.exp(1j * np.array([item.yaw for item in items])).mean()) < 0.1


def test_geometry_moves_models_rigidly():
    generator = GENERATORS[0]
    scene = generator.generate(1, 0)
    item = dataclasses.replace(scene.items[0], x=0.1, y=-0.2, yaw=np.pi / 2, scale=2.0)
    geometry = generator.geometry(dataclasses.replace(scene, items=(item,)))
    mesh = MODELS.model(item.label, item.instance)
    x, y, z = np.moveaxis(mesh.vertices[mesh.faces], -1, 0)
    expected = np.stack([0.1 - 2 * y, -0.2 + 2 * x, 2 * z], axis=-1)
    assert np.allclose(geometry.corners, expected, atol=1e-6)
    assert np.allclose(geometry.normals[..., 0], -mesh.normals[..., 1], atol=1e-6)
    assert geometry.textures.shape[0] == 1 + len(mesh.textures)
    assert np.allclose(geometry.textures[geometry.texture_of], mesh.textures[mesh.texture_of])


def test_an_empty_table():
    generator = TabletopGenerator(MODELS, minimum=0, maximum=0)
    geometry = generator.geometry(generator.generate(0, 0))
    assert geometry.corners.shape == (0, 3, 3)
    assert geometry.textures.shape[0] == 1


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"scenes": (1, 2)}, "a number for each of"),
        ({"minimum": 5, "maximum": 4}, "maximum = 4: expected 5 or more"),
        ({"border": 0.6}, "leave no room"),
    ],
)
def test_impossible_settings(changed, said):
    with pytest.raises(ConfigError, match=said):
        TabletopGenerator(MODELS, **changed)


def test_scenes_beyond_the_data_set():
    with pytest.raises(ConfigError, match=r"scene 647 is outside 0\.\.646"):
        GENERATORS[0].generate(647, 0)
    with pytest.raises(ConfigError, match="no split 'val'"):
        GENERATORS[0].numbers("val")
