"""A rule on components labels easy tables and fails on cluttered ones."""

import numpy as np
import pytest

from scenefw import registry
from scenefw.core.errors import ConfigError
from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.metrics.semantic import count_classes, mean_iou
from scenefw.renderers.mesh_raycaster import MeshRaycaster
from scenefw_labelling_studies.by_rule import ByRule
from scenefw_labelling_studies.components import FEATURES, answers, components, fitted

CLASSES = ("surface", "long", "square")
GRID = HeightGrid(65, 0.064)


def mean_iou_of(option, dataset, tables):
    """Of the rule on true heights of validation tables."""
    rule = registry.build("label_source", option)
    source = registry.build(
        "dataset", dataset, split="validation", limit=tables, cache=None, vertices=513
    )
    source.renderer = MeshRaycaster(contrast=1.0)  # colour does not matter
    counts = 0
    for scene in range(tables):
        truth = source.truth(scene)
        found = rule.label_map(truth).argmax(axis=0)
        counts = counts + count_classes(found, truth.labels, len(rule.classes))
    return mean_iou(counts)


def test_the_rule_solves_easy_tables():
    assert mean_iou_of("by_rule_easy", "tabletop_easy", 2) >= 0.98


@pytest.mark.exhaustive
def test_the_rule_fails_on_cluttered_tables():
    assert mean_iou_of("by_rule", "tabletop", 3) <= 0.45


def heights_of(*boxes):
    """A map with boxes (row, column, rows, columns, height in mm)."""
    heights = np.zeros(GRID.shape, dtype=np.float32)
    for row, column, rows, columns, high in boxes:
        heights[row : row + rows, column : column + columns] = high / 1000
    return heights


def map_of(heights):
    zeros = np.zeros(GRID.shape, dtype=np.float32)
    return HeightMap(GRID, heights, np.zeros((*GRID.shape, 3), np.uint8), zeros + 1, zeros)


def test_features_of_boxes():
    heights = heights_of((5, 5, 10, 30, 8), (30, 10, 12, 12, 20), (42, 22, 5, 5, 6))
    number, found = components(heights, 0.002, GRID.spacing)
    assert number.max() == 2  # two touch at a corner
    top, mean, length, width, rectangle, fill = found[0]
    assert [top, mean, length, width] == pytest.approx([0.008, 0.008, 0.03, 0.01], rel=1e-5)
    assert [rectangle, fill] == pytest.approx([3e-4, 1])
    assert found[1][FEATURES.index("mean")] == pytest.approx((144 * 20 + 25 * 6) / 169e3, rel=1e-5)
    assert found[1][FEATURES.index("fill")] < 0.9


def test_a_turned_rectangle_keeps_its_sides():
    y, x = np.mgrid[:65, :65] - 32.0
    c, s = np.cos(0.5), np.sin(0.5)
    inside = (np.abs(c * x + s * y) < 20) & (np.abs(c * y - s * x) < 6)
    _, found = components(np.where(inside, 0.01, 0).astype(np.float32), 0.002, GRID.spacing)
    assert found[0, 2:4] == pytest.approx([0.04, 0.012], abs=0.0015)
    assert found[0, 5] > 0.9


def test_maps_are_labelled_and_unseen_vertices_are_uniform():
    rule = ByRule(CLASSES, [("length", 0.02, "square", "long")])
    heights = heights_of((5, 5, 10, 30, 8), (40, 10, 12, 12, 20))
    heights[:, 60] = np.nan
    found = rule.label_map(map_of(heights))
    assert np.allclose(found.sum(axis=0), 1)
    labels = found.argmax(axis=0)
    assert (labels[6, 6], labels[41, 11], labels[0, 0]) == (1, 2, 0)
    assert np.allclose(found[:, :, 60], 1 / 3)


def test_questions_that_part_classes_are_found():
    rng = np.random.default_rng(0)
    features = rng.random((400, len(FEATURES)))
    truth = np.where(features[:, 2] < 0.3, 0, np.where(features[:, 5] < 0.6, 1, 2))
    rows = fitted(features, np.eye(3)[truth], CLASSES, leaves=3)
    assert [row[0] for row in rows] == ["length", "fill"]
    assert [row[1] for row in rows] == pytest.approx([0.3, 0.6], abs=0.02)
    assert answers(features, rows) == [CLASSES[label] for label in truth]


@pytest.mark.parametrize(
    ("tree", "said"),
    [
        ([], "tree is empty"),
        ([("colour", 1, "long", "square")], "expected one of top, mean"),
        ([("top", 1, "long")], "expected one of top, mean"),
        ([("top", 1, "long", "round")], "leads to round; expected a later row"),
        ([("top", 1, "long", 0)], "leads to 0; expected a later row"),
    ],
)
def test_trees_that_lead_nowhere(tree, said):
    with pytest.raises(ConfigError, match=said):
        ByRule(CLASSES, tree)


def test_numbers_out_of_range():
    with pytest.raises(ConfigError, match=r"confidence = 0\.2"):
        ByRule(CLASSES, [("top", 1, "long", "square")], confidence=0.2)
