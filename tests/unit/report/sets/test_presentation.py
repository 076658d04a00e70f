from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, GridSpec
from scenefw.evaluation.sets.results import (
    DecomposedScene,
    DecompositionResult,
    SceneCodes,
    SetExample,
)
from scenefw.evaluation.several import SeveralResults
from scenefw.report.blocks import Picture
from scenefw.report.presentation import Chapter
from scenefw.report.sets.codes import neighbour_map, principal_components
from scenefw.report.sets.examples import distances, draw_example

GRID = GridSpec(16)


def result(published="of_six", *, codes=True, examples=True):
    rng = np.random.default_rng(0)
    labels = np.zeros(GRID.shape, np.int64)
    labels[4:8, 4:8, 2:6], labels[9:12, 9:12, 2:6] = 1, 2
    camera = Camera(40, 30, 35.0, 35.0, 19.5, 14.5, look_at((0.9, 0.0, 0.7), (0, 0, 0.1)))
    example = SetExample(7, GRID, camera, np.ones((30, 40), np.float32),
                         {"truth": labels, "ours": np.where(labels == 1, 2, 0)})  # fmt: skip
    scenes = []
    for number in range(3):
        features = rng.normal(size=(5, 8)).astype(np.float32)
        one = SceneCodes(features, np.array([0, 3]), np.array([True, False]), features.T[:2])
        scores = {
            "ours": {"missing_or_joined": 0.5, "cross_entropy": 0.01, "missing": 0.5},
            "components": {"missing_or_joined": 1.0},
        }
        scenes.append(DecomposedScene(number, 2, scores, one if codes else None))
    return DecompositionResult(
        tuple(scenes), ("ours", "components"), published, (example,) * examples
    )


def test_the_page_has_the_thesiss_row_the_codes_and_pictures(tmp_path):
    sections = Chapter("scenefw.report.sets").sections(result(), tmp_path)
    assert [one.title.split(": ")[1] for one in sections] == [
        "decomposition", "codes", "test scenes",
    ]  # fmt: skip
    table = sections[0].blocks[0]
    names = [column.name for column in table.columns]
    rows = dict(table.rows)
    at = names.index("missing or joined (%)")
    assert rows["ours"][at] == pytest.approx(50.0)
    assert rows["thesis, table 6.1 (published)"][at] == pytest.approx(2.4)
    assert rows["components"][names.index("BCE (nats)")] is None
    assert table.quoted == {"thesis, table 6.1 (published)"}
    assert len(sections[1].blocks) == 3
    (picture,) = sections[2].blocks
    assert isinstance(picture, Picture)
    with Image.open(tmp_path / picture.path) as image:
        pixels = np.asarray(image)
    assert pixels.std() > 10


@pytest.mark.parametrize(("methods", "across", "down"), [(3, 5, 2), (5, 4, 4), (6, 4, 4)])
def test_many_methods_take_several_rows(methods, across, down, monkeypatch):
    monkeypatch.setattr("scenefw.report.sets.examples._SIZE", (40, 30))
    (example,) = result().examples
    labels = {"truth": example.labels["truth"]}
    labels |= {f"method {i}": example.labels["ours"] for i in range(methods)}
    picture = draw_example(replace(example, labels=labels))
    assert picture.shape == (down * (30 + 22 + 6) - 6, across * (40 + 6) - 6, 3)


def test_without_codes_or_a_thesis_nothing_is_invented(tmp_path):
    sections = Chapter("scenefw.report.sets").sections(
        result(None, codes=False, examples=False), tmp_path
    )
    assert [one.title for one in sections] == [
        "Scenes as sets: decomposition",
    ]  # fmt: skip
    assert not sections[0].blocks[0].quoted


@pytest.mark.exhaustive
def test_parts_follow_each_other(tmp_path):
    parts = {name: result(name, examples=False) for name in ("of_six", "of_four_to_eight")}
    titles = [
        one.title
        for one in Chapter("scenefw.report.sets").sections(SeveralResults(parts), tmp_path)
    ]
    assert titles[0] == "6 objects: decomposition"
    assert titles[2] == "4 to 8 objects: decomposition"


def test_components_are_the_directions_of_largest_variance():
    rng = np.random.default_rng(0)
    rows = rng.normal(size=(50, 4)) * (5, 1, 3, 0.1)
    found = principal_components(rows)
    values, vectors = np.linalg.eigh(np.cov(rows.T))
    expected = (rows - rows.mean(axis=0)) @ vectors[:, np.argsort(-values)[:2]]
    np.testing.assert_allclose(np.abs(found), np.abs(expected), atol=1e-9)
    assert principal_components(rows[:0]).shape == (0, 2)
    assert not principal_components(rows[:1]).any()


def test_like_codes_are_neighbours_in_the_map():
    rng = np.random.default_rng(1)
    groups = np.repeat(np.arange(3), 20)
    rows = rng.normal(size=(3, 8))[groups] * 10 + rng.normal(size=(60, 8))
    found = neighbour_map(rows)
    gaps = np.linalg.norm(found[:, None] - found, axis=-1) + 1e9 * np.eye(60)
    assert (groups[gaps.argmin(axis=1)] == groups).all()
    np.testing.assert_array_equal(neighbour_map(rows), found)
    assert not neighbour_map(rows[:4]).any()
    assert np.isfinite(neighbour_map(np.ones((6, 8)))).all()


def test_distances_are_signed_and_smooth():
    inside = np.zeros(GRID.shape, bool)
    inside[4:12, 4:12, 4:12] = True
    found = distances(inside, GRID)
    assert found[8, 8, 8] == pytest.approx(-3.5 * GRID.voxel_size, rel=0.2)
    assert (found[inside] < 0).mean() > 0.9
    assert (found[~inside] > 0).all()
    assert (distances(np.zeros_like(inside), GRID) > 0).all()


def test_the_network_of_an_experiment_has_a_name_that_says_so(tmp_path):
    made = result(examples=False)
    scenes = tuple(
        replace(scene, scores={"set_network": scene.scores["ours"], "set_extents": {}})
        for scene in made.scenes
    )
    named = replace(made, scenes=scenes, methods=("set_network", "set_extents"))
    for table in Chapter("scenefw.report.sets").sections(named, tmp_path)[0].blocks[:2]:
        assert {"set network", "set extents"} <= set(dict(table.rows))
        assert "set_network" not in dict(table.rows)
