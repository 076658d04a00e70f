from dataclasses import replace

import numpy as np
import pytest
from tests.unit.data import damaged
from tests.unit.mapping import tables

from scenefw.core.errors import InputError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.mapping.semantic_fusion import SemanticFusion

GRID = HeightGrid(vertices=17, extent=0.16, lower=(-0.08, -0.05), levels=2)
FIELDS = ("heights", "colour", "confidence", "variance", "labels", "sources")


def example():
    rng = np.random.default_rng(0)
    heights = rng.normal(0, 0.1, GRID.shape).astype(np.float32)
    heights[:3] = np.nan
    probabilities = rng.dirichlet(np.ones(3), GRID.shape).transpose(2, 0, 1).astype(np.float32)
    return HeightMap(
        GRID,
        heights,
        rng.integers(0, 255, (*GRID.shape, 3), dtype=np.uint8),
        rng.random(GRID.shape, dtype=np.float32),
        rng.random(GRID.shape, dtype=np.float32),
        probabilities,
        rng.integers(-1, 3, GRID.shape, dtype=np.int32),
        rng.integers(0, 4, GRID.shape, dtype=np.uint8),
        ("surface", "coin", "pen"),
    )


def test_a_map_comes_back(tmp_path):
    before = example()
    path = save_map(tmp_path / "maps" / "one", before)
    assert path.name == "one.npz"
    after = load_map(path, GRID).height_map
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
        assert getattr(after, name).dtype == getattr(before, name).dtype
    np.testing.assert_allclose(after.probabilities, before.probabilities, atol=1e-3)
    np.testing.assert_allclose(after.probabilities.sum(axis=0), 1, atol=1e-6)
    assert after.classes == before.classes
    assert after.grid == GRID


def test_what_is_unknown_stays_none(tmp_path):
    before = replace(example(), probabilities=None, labels=None, sources=None, classes=())
    saved = load_map(save_map(tmp_path / "one.npz", before))
    assert saved.height_map.probabilities is None
    assert saved.height_map.labels is None
    assert saved.height_map.sources is None
    assert saved.height_map.classes == ()
    assert saved.states == {}


def test_states_come_back(tmp_path):
    states = {"heights": {"sums": np.arange(6.0).reshape(2, 3)}, "labels": {"logits": np.ones(4)}}
    saved = load_map(save_map(tmp_path / "one.npz", example(), states))
    assert saved.states.keys() == states.keys()
    np.testing.assert_array_equal(saved.states["heights"]["sums"], states["heights"]["sums"])
    np.testing.assert_array_equal(saved.states["labels"]["logits"], states["labels"]["logits"])


def changed(path, **values):
    with np.load(path) as file:
        content = dict(file)
    content |= {key: value for key, value in values.items() if value is not None}
    for key in [key for key, value in values.items() if value is None]:
        del content[key]
    np.savez(path, **content)
    return path


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"version": np.array(99)}, "version 99, expected 1"),
        ({"version": None}, "version none"),
        ({"heights": None}, "lacks heights"),
        ({"grid": np.array([16, 1, 0, 0, 2])}, "damaged grid"),
        ({"grid": np.zeros(3)}, "damaged grid"),
        ({"labels": np.zeros((4, 4))}, r"labels of shape \(4, 4\)"),
        ({"colour": np.zeros((4, 4, 3))}, "colour of shape"),
        ({"version": np.array(1.5)}, "version 1.5"),
        ({"grid": np.array([17.7, 0.16, -0.08, -0.05, 2])}, "damaged grid"),
        ({"grid": np.array([17, 0.16, np.nan, -0.05, 2])}, "damaged grid"),
        ({"colour": np.zeros((17, 17, 2), np.uint8)}, r"colour of shape .*expected \(17, 17, 3\)"),
        ({"colour": np.full((17, 17, 3), 300)}, "colour of 300, expected .* 0 to 255"),
        ({"colour": np.zeros((17, 17, 3))}, "colour of float64, expected whole numbers"),
        ({"heights": np.full((17, 17), np.inf)}, "heights of inf"),
        ({"confidence": np.full((17, 17), np.nan)}, "confidence of nan"),
        ({"variance": np.full((17, 17), -1.0)}, "variance of -1"),
        (
            {"probabilities": np.ones((2, 17, 17))},
            r"probabilities of shape .*expected \(3, 17, 17\)",
        ),
        ({"probabilities": np.full((3, 17, 17), np.nan)}, "probabilities of nan"),
        ({"probabilities": np.zeros((3, 17, 17))}, "add up to 0 at 289 vertices"),
        ({"labels": np.full((17, 17), 3)}, "labels of 3, expected .* -1 to 2"),
        ({"sources": np.full((17, 17), 4)}, "sources of 4"),
        ({"state/heights/sums": np.array([0.0, np.nan])}, "state/heights/sums with numbers"),
    ],
)
def test_damaged_files_are_named(tmp_path, values, message):
    path = changed(save_map(tmp_path / "one.npz", example()), **values)
    with pytest.raises(InputError, match=message) as raised:
        load_map(path)
    assert "\n" not in str(raised.value)
    assert str(path) in str(raised.value)


def test_another_grid_a_missing_and_a_cut_file_are_named(tmp_path):
    path = save_map(tmp_path / "one.npz", example())
    with pytest.raises(InputError, match=r"expected HeightGrid.vertices=33"):
        load_map(path, HeightGrid(33, 0.16, (-0.08, -0.05), 2))
    with pytest.raises(InputError, match="no map file"):
        load_map(tmp_path / "two.npz")
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(InputError, match="is the file complete"):
        load_map(path)


def test_fusion_goes_on_from_a_file_as_if_never_interrupted(tmp_path):
    grid, fusion, semantic = tables.LEVELS, HeightFusion(tables.LEVELS), SemanticFusion()
    frames = [tables.boxes(view) for view in tables.views(4)]
    said = np.full((3, 60, 80), 0.2, np.float32)
    said[1] = 0.6
    heights, labels = fusion.begin(), semantic.begin(grid, 3)
    for frame in frames[:2]:
        heights.add(frame)
        labels.add(said, frame)
    states = {"heights": heights.state(), "labels": labels.state()}
    saved = load_map(save_map(tmp_path / "one.npz", heights.height_map(), states), grid)
    resumed = fusion.begin(saved.height_map, saved.states["heights"])
    relabelled = semantic.begin(grid, 3, state=saved.states["labels"])
    for frame in frames[2:]:
        for running in (heights, resumed):
            running.add(frame)
        for running in (labels, relabelled):
            running.add(said, frame)
    np.testing.assert_array_equal(resumed.height_map().heights, heights.height_map().heights)
    np.testing.assert_array_equal(relabelled.probabilities(), labels.probabilities())


@pytest.mark.parametrize("kind", damaged.KINDS)
def test_damaged_archives_are_one_line(tmp_path, kind):
    content = {"grid": np.zeros(6), "heights": np.zeros((3, 3))}
    path = damaged.write(tmp_path / "one.npz", kind, content)
    with pytest.raises(InputError, match=r"cannot read map .*one\.npz") as raised:
        load_map(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "values", [{"heights": np.full((65, 65), "x")}, {"version": np.array("one")}]
)
def test_parts_of_another_kind_are_one_line(tmp_path, values):
    path = changed(save_map(tmp_path / "one.npz", example()), **values)
    with pytest.raises(InputError, match=r"map .*one\.npz") as raised:
        load_map(path)
    assert "\n" not in str(raised.value)
