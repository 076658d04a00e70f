"""Ends of parts that move to edges of a colour image, whose outlines are known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import binary_dilation, distance_transform_edt, gaussian_filter
from tests.unit.perception.blurred import seen

from scenefw.core.errors import ConfigError
from scenefw.perception.observation.observation import Observation
from scenefw.perception.segmentation.colour_edges import ColourEdges
from scenefw_single_view_benchmarks.mask_scores import mask_scores

SIZES = [(240, 320), (480, 640)]


def discs(size):
    """Labels of a disc and of a smaller one that hides part of it, and their colours."""
    height, width = size
    v, u = np.mgrid[:height, :width] / height
    labels = np.zeros(size, np.int32)
    labels[np.hypot(u - 0.5, v - 0.5) < 0.25] = 1
    labels[np.hypot(u - 0.75, v - 0.5) < 0.12] = 2
    paint = np.array([[110, 100, 90], [180, 30, 30], [30, 60, 170]])[labels].astype(float)
    noise = np.random.default_rng(0).normal(size=(height, width, 3))
    paint += 4 * noise
    return labels, np.clip(paint, 0, 255).astype(np.uint8)


def wrong_ends(labels, width, seed=0):
    """Parts whose ends lie up to `width` pixels off, further out in some places, in in others."""
    field = gaussian_filter(np.random.default_rng(seed).normal(size=labels.shape), 12)
    off = width * np.clip(field / (2 * field.std()), -1, 1)
    signed = [
        np.where(
            labels == k, -distance_transform_edt(labels == k), distance_transform_edt(labels != k)
        )
        for k in (1, 2)
    ]
    found = np.zeros_like(labels)
    found[signed[0] < off] = 1
    found[signed[1] < off] = 2
    return found


@pytest.mark.parametrize("size", SIZES)
def test_ends_move_to_where_colour_has_them(size):
    labels, colour = discs(size)
    width = round(8 * size[1] / 640)
    parts = wrong_ends(labels, width)
    before = mask_scores(parts, labels, 0.001)
    after = mask_scores(ColourEdges().refined(parts, colour, width), labels, 0.001)
    assert before.boundary_f < 0.75
    assert after.boundary_f > 0.95
    assert after.overlap_f > 0.99


def test_without_edges_of_colour_ends_hardly_move():
    labels, _ = discs(SIZES[0])
    grey = np.full((*labels.shape, 3), 128, np.uint8)
    found = ColourEdges().refined(labels, grey, 4)
    assert mask_scores(found, labels, 0.005).boundary_f > 0.95


@given(st.integers(0, 1000), st.integers(1, 8))
@settings(max_examples=10, deadline=None)
def test_what_is_further_from_ends_stays(seed, width):
    """Whatever the colours."""
    labels, _ = discs(SIZES[0])
    colour = np.random.default_rng(seed).integers(0, 256, (*labels.shape, 3), dtype=np.uint8)
    found = ColourEdges().refined(labels, colour, width)
    outside = distance_transform_edt(labels == 0) > width + 1
    assert not found[outside].any()
    for k in (1, 2):
        inside = distance_transform_edt(labels == k) > width + 1
        assert (found[inside] == k).all()


def test_small_parts_and_parts_at_the_edge_of_the_image_stay():
    labels = np.zeros((60, 80), np.int32)
    labels[20:24, 30:34] = 3  # narrower than the band
    labels[40:, :20] = 7
    colour = np.where(labels[..., None] > 0, np.uint8(200), np.uint8(50)).repeat(3, axis=-1)
    found = ColourEdges().refined(labels, colour, 8)
    assert set(np.unique(found)) == {0, 3, 7}
    assert (found[40:, :20] == 7).mean() > 0.95
    assert not ColourEdges().refined(0 * labels, colour, 8).any()


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_ends_move_by_as_much_as_ramps_are_wide(size):
    sharp, blurred, pixels = seen(size, 6)
    far = binary_dilation(sharp.labels > 0, iterations=pixels // 2).astype(np.int32)
    paint = np.where(sharp.labels[..., None] > 0, [200, 60, 40], [90, 90, 80]).astype(np.uint8)
    found = ColourEdges().moved(far, Observation(replace(blurred, colour=paint)))
    assert (found != sharp.labels).sum() < 0.2 * (far != sharp.labels).sum()
    lost = np.random.default_rng(0).random(far.shape) < 0.03
    holes = np.where(lost, np.float32(0), blurred.depth)
    view = Observation(replace(blurred, colour=paint, depth=holes))
    found = ColourEdges().moved(far, view)
    assert found.any()
    assert not found[lost].any()


def test_without_colour_or_ramps_parts_stay():
    sharp, blurred, pixels = seen((640, 480), 6)
    far = binary_dilation(sharp.labels > 0, iterations=pixels // 2).astype(np.int32)
    paint = np.where(sharp.labels[..., None] > 0, [200, 60, 40], [90, 90, 80]).astype(np.uint8)
    assert ColourEdges().moved(far, Observation(blurred)) is far
    view = Observation(replace(blurred, colour=paint))
    assert ColourEdges().moved(far, view) is not far
    assert ColourEdges().moved(0 * far, view).max() == 0
    exact, _, _ = seen((640, 480), 0, noise=0.0)
    _, unblurred, _ = seen((640, 480), 0)
    for one in (exact, unblurred):
        view = Observation(replace(one, colour=paint))
        assert ColourEdges().moved(sharp.labels, view) is sharp.labels


def test_bad_settings():
    with pytest.raises(ConfigError, match=r"^min_width = 0"):
        ColourEdges(min_width=0)
    with pytest.raises(ConfigError, match=r"^max_width = 2"):
        ColourEdges(min_width=3, max_width=2)
