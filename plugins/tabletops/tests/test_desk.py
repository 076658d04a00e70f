"""Cluttered tables: what lies how, determinism, splits, refusals."""

import numpy as np
import pytest
from scipy import ndimage

from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightGrid
from scenefw.core.tabletop import DESK, SPLITS
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_tabletops.scenes.desk import DeskGenerator
from scenefw_tabletops.scenes.tabletop import rotation_of
from scenefw_tabletops.shapes.desk.library import DeskModels

MODELS = DeskModels()
GENERATOR = DeskGenerator(MODELS, scenes=(500, 120, 27, 5))


@pytest.fixture(scope="module")
def scenes():
    return [GENERATOR.generate(index, 0) for index in (0, 505, 640, 650)]


def test_tables_are_full_and_inside(scenes):
    for scene in scenes:
        assert len(scene.items) > 30
        corners = GENERATOR.geometry(scene).corners
        assert np.abs(corners[..., :2]).max() < 0.53  # plugs and corners of what leans
        assert corners[..., 2].min() > -1e-5
        assert corners[..., 2].max() < 0.12


def test_things_lean_lie_on_each_other_and_touch(scenes):
    items = [item for scene in scenes for item in scene.items]
    tilts = np.array([np.arccos(np.clip(rotation_of(i)[2, 2], -1, 1)) for i in items])
    heights = np.array([item.z for item in items])
    leaning = (tilts > np.deg2rad(2)) & (tilts < np.deg2rad(29))
    assert leaning.mean() > 0.08
    assert (heights > 0.004).mean() > 0.1
    assert any(max(item.lifts, default=0) > 0.005 for item in items)  # a cable over something


@pytest.mark.exhaustive
def test_few_components_hold_one_thing(scenes):
    """Most of what is above the table touches something of another class."""
    grid = HeightGrid(513)
    shared = whole = 0
    for scene in scenes:
        truth = MeshRaycaster(contrast=1.0).height_map(GENERATOR.geometry(scene), grid)
        number, count = ndimage.label(truth.labels > 0, np.ones((3, 3)))
        for part in range(1, count + 1):
            inside = truth.labels[number == part]
            whole += len(inside)
            shared += len(inside) * (len(np.unique(inside)) > 1)
    assert shared > 0.6 * whole


@pytest.mark.exhaustive
def test_what_lies_later_does_not_sink_into_what_is_there(scenes):
    """Seen from above, an item is never more than 2 mm below where something lay before it."""
    scene = scenes[0]
    grid = HeightGrid(257)
    renderer = MeshRaycaster(contrast=1.0)
    first = GENERATOR.geometry(type(scene)(**{**vars(scene), "items": scene.items[:19]}))
    last = renderer.height_map(first, grid).heights
    sunk = []
    for count in range(20, 28):
        items = scene.items[:count]
        part = GENERATOR.geometry(type(scene)(**{**vars(scene), "items": items}))
        alone = GENERATOR.geometry(type(scene)(**{**vars(scene), "items": items[-1:]}))
        top = renderer.height_map(part, grid).heights
        own = renderer.height_map(alone, grid)
        sunk.append(((own.labels > 0) & (own.heights < last - 0.002)).sum()
                    / max(1, (own.labels > 0).sum()))  # fmt: skip
        last = top
    assert np.mean(sunk) < 0.02


def test_a_scene_depends_on_seed_and_index_alone(scenes):
    fresh = DeskGenerator(DeskModels())
    assert fresh.generate(505, 0) == scenes[1]
    assert fresh.generate(505, 1) != scenes[1]


@pytest.mark.parametrize(
    ("split", "place"), [("train", 0), ("validation", 1), ("test", 2), ("final", 3)]
)
def test_models_of_a_split_lie_in_its_scenes_alone(scenes, split, place):
    assert scenes[place].index in GENERATOR.numbers(split)
    for item in scenes[place].items:
        assert item.instance in MODELS.instances(item.label, split)


def test_the_final_split_has_models_of_its_own():
    for label in range(1, len(DESK)):
        final = set(MODELS.instances(label, "final"))
        assert final
        assert not final & {i for s in SPLITS for i in MODELS.instances(label, s)}


def test_tables_without_a_final_split_say_so():
    with pytest.raises(ConfigError, match="no split 'final'; there are train, validation, test"):
        DeskGenerator(MODELS).numbers("final")


def test_classes_are_drawn_by_weight():
    only = DeskGenerator(MODELS, minimum=4, maximum=6,
                         weights={name: 0.0 for name in DESK[1:] if name != "coin"})  # fmt: skip
    assert {item.label for item in only.generate(0, 0).items} == {DESK.index("coin")}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"scenes": (1, 2)}, "a number for each of train, validation, test"),
        ({"minimum": 5, "maximum": 4}, "maximum = 4: expected 5 or more"),
        ({"border": 0.6}, "leaves no room"),
        ({"placed": (0, 0, 0)}, "three shares"),
        ({"steepest": 80}, "steepest = 80"),
        ({"weights": {"spoon": 1}}, "expected numbers from 0 on for remote_control"),
    ],
)
def test_impossible_settings(changed, said):
    with pytest.raises(ConfigError, match=said):
        DeskGenerator(MODELS, **changed)
