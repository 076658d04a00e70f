"""Parts of several images that show the same surface."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw_decomposing.same_surface import SurfaceOverlap


def strip(first, last, step=0.002):
    """Points of a strip along x, one row of an image."""
    x = np.arange(first, last, step)
    return np.stack([x, np.zeros_like(x), np.full_like(x, 0.1)], axis=-1)


def image(*strips):
    """Parts (1, W) and points (1, W, 3) of strips given as (label, first, last)."""
    rows = [strip(first, last) for _, first, last in strips]
    labels = [np.full(len(row), label) for (label, _, _), row in zip(strips, rows, strict=True)]
    return np.concatenate(labels)[None].astype(np.int32), np.concatenate(rows)[None]


def joined(*images, **settings):
    parts, points = zip(*images, strict=True)
    return SurfaceOverlap(**settings).joined(parts, points).tolist()


def test_parts_that_overlap_enough_are_one():
    assert joined(image((1, 0.0, 0.1)), image((2, 0.05, 0.15))) == [0, 1, 1]
    assert joined(image((1, 0.0, 0.1)), image((2, 0.08, 0.18))) == [0, 1, 2]
    assert joined(image((1, 0.0, 0.1)), image((2, 0.08, 0.18)), min_ratio=0.2) == [0, 1, 1]


def test_a_chain_of_views_goes_around_an_object():
    views = [image((i + 1, 0.05 * i, 0.05 * i + 0.1)) for i in range(4)]
    assert joined(*views) == [0, 1, 1, 1, 1]


def test_a_part_that_meets_several_of_another_image_joins_none():
    """One of both images is wrong, and points don't say which."""
    cut, whole = image((1, 0.0, 0.1), (2, 0.11, 0.2)), image((3, 0.0, 0.2))
    assert joined(cut, whole) == [0, 1, 2, 3]


def test_two_parts_of_one_image_are_never_joined_through_others():
    first = image((1, 0.0, 0.1), (2, 0.2, 0.3))
    bridges = [image((3, 0.05, 0.16)), image((4, 0.1, 0.2)), image((5, 0.14, 0.26))]
    table = joined(first, *bridges)
    assert table[1] != table[2]


def test_images_without_parts():
    empty = np.zeros((1, 5), np.int32), np.full((1, 5, 3), np.nan)
    assert joined(empty, image((1, 0.0, 0.1)), empty) == [0, 1]
    assert joined(empty) == [0]


@given(st.permutations(range(4)), st.integers(0, 2**32 - 1))
def test_neither_order_nor_place_matters(order, seed):
    views = [image((i + 1, 0.06 * i, 0.06 * i + 0.1)) for i in range(3)] + [image((4, 0.5, 0.6))]
    moved = np.random.default_rng(seed).normal(size=3)
    parts, points = zip(*[(views[i][0], views[i][1] + moved) for i in order], strict=True)
    assert SurfaceOverlap().joined(parts, points).tolist() == [0, 1, 1, 1, 4]


@pytest.mark.parametrize(
    "wrong", [{"inlier_distance": 0.0}, {"min_ratio": 0.0}, {"min_ratio": 1.1}]
)
def test_settings_out_of_range(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        SurfaceOverlap(**wrong)
