"""Models of desks: whole, alike across classes, and never the same in two splits."""

from itertools import combinations

import numpy as np
import pytest

from scenefw.core.errors import ConfigError
from scenefw.core.tabletop import DESK, SPLITS, TEXTURE
from scenefw_tabletops.shapes.desk.library import OTHERS, DeskModels

MODELS = DeskModels()
NAMED = [name for name in DESK[1:] if name != "other"]
LONGEST = {  # m, of all instances
    "remote_control": (0.08, 0.28), "keyboard": (0.05, 0.46), "model_plane": (0.045, 0.40),
    "coin": (0.015, 0.035), "cable": (0.05, 0.55), "pen": (0.06, 0.20), "brick": (0.007, 0.14),
    "paperclip": (0.022, 0.075), "book": (0.08, 0.29), "other": (0.01, 0.35),
}  # fmt: skip


def models(name, numbers):
    return [MODELS.model(DESK.index(name), number) for number in numbers]


def some(name):
    return models(name, range(len(OTHERS) if name == "other" else 8))


def extents(name):
    return np.array([np.ptp(model.vertices, axis=0) for model in some(name)])


@pytest.mark.parametrize("name", DESK[1:])
def test_models_are_whole_and_as_large_as_the_thing(name):
    for model in some(name):
        low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
        assert LONGEST[name][0] <= (high - low)[:2].max() <= LONGEST[name][1]
        assert low[2] == pytest.approx(0, abs=1e-12)
        assert 0.0002 < high[2] < 0.12
        assert np.isfinite(model.normals).all()
        assert model.faces.max() < len(model.vertices)
        assert len(model.faces) < 8000
        assert model.textures.shape[1] == TEXTURE
        assert set(np.unique(model.texture_of)) <= set(range(len(model.textures)))
        a, b, c = np.moveaxis(model.vertices[model.faces], 1, 0)
        assert (a * np.cross(b, c)).sum() > 0  # faces point outwards


def test_things_low_and_thin_are_near_the_noise():
    assert 0.0012 < extents("coin")[:, 2].min() < 0.002
    assert extents("paperclip")[:, 2].min() < 0.0012
    assert (extents("other")[:, 2] < 0.0005).any()  # paper


def test_sizes_of_classes_overlap():
    """The area that a class covers says little: ranges of classes of large things intersect."""
    every = {
        name: np.prod([np.ptp(m.vertices, axis=0)[:2] for m in models(name, range(30))], axis=1)
        for name in ("remote_control", "keyboard", "model_plane", "book", "other")
    }
    for first, second in combinations(every.values(), 2):
        for one, other in ((first, second), (second, first)):
            assert ((one > other.min()) & (one < other.max())).mean() > 0.3


@pytest.mark.parametrize("name", DESK[1:])
def test_splits_share_neither_shape_nor_texture(name):
    label = DESK.index(name)
    few = {split: list(MODELS.instances(label, split))[:26] for split in SPLITS}
    assert all(few.values())
    for look in (
        lambda m: np.ptp(m.vertices, axis=0).round(7).tobytes(),
        lambda m: np.concatenate([m.colours.mean(axis=0), m.textures.ravel()]).tobytes(),
    ):
        found = [{look(model) for model in models(name, few[split])} for split in SPLITS]
        for first, second in combinations(found, 2):
            assert not first & second


def test_bricks_come_in_no_standard_sizes():
    sizes = [tuple(np.ptp(m.vertices, axis=0).round(4)) for m in models("brick", range(66))]
    assert len(set(sizes)) == 66


def test_every_split_has_every_kind_of_other_thing():
    other = DESK.index("other")
    for split in SPLITS:
        kinds = {number % len(OTHERS) for number in MODELS.instances(other, split)}
        assert len(kinds) == len(OTHERS)


def test_numbers_alone_make_a_model():
    again, elsewhere = DeskModels(), DeskModels(seed=1)
    for label in range(1, len(DESK)):
        first = MODELS.model(label, 5)
        assert np.array_equal(first.vertices, again.model(label, 5).vertices)
        other = elsewhere.model(label, 5).vertices
        assert first.vertices.shape != other.shape or not np.allclose(first.vertices, other)


def test_cables_follow_their_spines():
    cable = MODELS.model(DESK.index("cable"), 2)
    near = np.linalg.norm(cable.vertices - cable.spine[cable.knots], axis=1)
    assert np.quantile(near, 0.8) < 0.004
    assert near.max() < 0.06  # plugs


def test_what_there_is_not():
    with pytest.raises(ConfigError, match="2 models of a class can't be split"):
        DeskModels(count=2)
    with pytest.raises(ConfigError, match="split 'all' is unknown"):
        MODELS.instances(1, "all")
