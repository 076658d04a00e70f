"""Labels on maps: known where probabilities are not uniform and the vertex has a height."""

import numpy as np

from scenefw.core.height_maps import HeightGrid, HeightMap
from scenefw.core.labels import (
    FROM_MAP,
    FROM_VIEWS,
    NO_SOURCE,
    UNKNOWN,
    known_mask,
    labelled,
    unlabelled,
)

GRID = HeightGrid(3, 0.2, (-0.1, -0.1), 1)
CLASSES = ("surface", "coin", "book")


def height_map():
    """Nine vertices, of which the last has no height."""
    heights = np.zeros(GRID.shape, np.float32)
    heights[2, 2] = np.nan
    colour = np.zeros((*GRID.shape, 3), np.uint8)
    ones = np.ones(GRID.shape, np.float32)
    return HeightMap(GRID, heights, colour, ones, ones)


def probabilities():
    """Uniform but for three vertices, the last among them."""
    found = np.full((3, *GRID.shape), 1 / 3, np.float32)
    found[:, 0, 1] = (0.2, 0.5, 0.3)
    found[:, 1, 0] = (0.1, 0.2, 0.7)
    found[:, 2, 2] = (0.9, 0.1, 0.0)
    return found


def test_uniform_probabilities_are_no_knowledge():
    expected = np.zeros(GRID.shape, bool)
    expected[[0, 1, 2], [1, 0, 2]] = True
    np.testing.assert_array_equal(known_mask(probabilities()), expected)


def test_a_map_has_the_most_probable_class_and_where_it_is_from():
    sources = np.full(GRID.shape, FROM_VIEWS, np.uint8)
    sources[1, 0] = FROM_MAP
    found = labelled(height_map(), probabilities(), CLASSES, sources)
    labels = np.full(GRID.shape, UNKNOWN)
    labels[0, 1], labels[1, 0] = 1, 2  # the vertex without a height stays unknown
    np.testing.assert_array_equal(found.labels, labels)
    origin = np.full(GRID.shape, NO_SOURCE)
    origin[0, 1], origin[1, 0] = FROM_VIEWS, FROM_MAP
    np.testing.assert_array_equal(found.sources, origin)
    assert found.classes == CLASSES


def test_nothing_is_known_of_an_unlabelled_map():
    found = unlabelled(height_map(), CLASSES)
    assert (found.labels == UNKNOWN).all()
    assert (found.sources == NO_SOURCE).all()
    np.testing.assert_allclose(found.probabilities.sum(axis=0), 1, rtol=1e-6)
