"""Edges of colour along borders of regions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError
from scenefw.perception.segmentation.border_colours import BorderColours
from scenefw.perception.segmentation.regions import along_borders

FLOOR, RED, BLUE = (90, 90, 80), (200, 40, 40), (40, 60, 200)


def two_regions(first, second, size=(120, 160), step=1):
    """A box cut in two by the middle of the image, with their colours, and its thinned regions."""
    height, width = size
    regions = np.zeros(size, np.int32)
    regions[height // 4 : 3 * height // 4, width // 4 : width // 2] = 1
    regions[height // 4 : 3 * height // 4, width // 2 : 3 * width // 4] = 2
    colour = np.array([FLOOR, first, second], np.uint8)[regions]
    return regions[::step, ::step], colour, step


def mean_added(regions, colour, step, **settings):
    """To the probability of the border between both regions."""
    sums, lengths = along_borders(regions, *BorderColours(**settings).added(regions, colour, step))
    return sums[1, 2] / lengths[1, 2]


@pytest.mark.parametrize(("size", "step"), [((120, 160), 1), ((480, 640), 2)])
def test_one_colour_joins_and_two_part(size, step):
    assert mean_added(*two_regions(RED, RED, size, step)) == pytest.approx(0.4, abs=0.02)
    assert mean_added(*two_regions(RED, BLUE, size, step), neutral=1.0) < 0
    assert mean_added(*two_regions(RED, RED, size, step), weight=0.1) < 0.11


def test_an_edge_as_strong_as_outer_ones_adds_what_is_neutral_above_it():
    """Grey steps of equal height: floor, first region, second region."""
    paint = [(60, 60, 60), (120, 120, 120), (60, 60, 60)]
    regions, colour, step = two_regions(paint[1], paint[2])
    colour[regions == 0] = paint[0]
    colour[:, 80:][regions[:, 80:] == 0] = (120, 120, 120)
    assert abs(mean_added(regions, colour, step, neutral=1.0)) < 0.05
    assert mean_added(regions, colour, step) == pytest.approx(0.3, abs=0.05)


@given(st.integers(0, 1000), st.floats(0, 0.9), st.floats(0, 2))
@settings(max_examples=20, deadline=None)
def test_never_more_than_a_weight_for_each_step_of_strength(seed, weight, neutral):
    random = np.random.default_rng(seed)
    regions = random.integers(0, 4, (30, 40)).repeat(2, 0).repeat(2, 1).astype(np.int32)
    colour = random.integers(0, 256, (60, 80, 3), dtype=np.uint8)
    across, down = BorderColours(weight, neutral).added(regions, colour, 1)
    assert (across.shape, down.shape) == ((60, 79), (59, 80))
    for one in (across, down):
        assert np.isfinite(one).all()
        assert one.max() <= weight + 1e-6
        assert one.min() >= weight * (neutral - 2) - 1e-6


def test_without_regions_or_edges_nothing_changes():
    """Of an image of one colour, or of none, nothing is known."""
    none = np.zeros((120, 160), np.int32)
    regions, _, _ = two_regions(RED, RED)
    for value in (0, 80, 255):
        plain = np.full((120, 160, 3), value, np.uint8)
        for one in (none, regions):
            assert not any(added.any() for added in BorderColours().added(one, plain, 1))
    regions[:] = 1  # no end of it is seen
    _, colour, _ = two_regions(RED, BLUE)
    assert not any(added.any() for added in BorderColours().added(regions, colour, 1))


def test_regions_as_wide_as_the_image_count_too():
    """Their upper and lower ends say how strong edges are."""
    regions = np.zeros((120, 160), np.int32)
    regions[40:60], regions[60:80] = 1, 2
    for paint, sign in (((FLOOR, RED, RED), 1), (((120, 110, 100), (140, 130, 120), BLUE), -1)):
        colour = np.array(paint, np.uint8)[regions]
        if sign < 0:
            colour[:40] = colour[80:] = (120, 110, 100)
            colour[80:] = (35, 55, 195)
        assert np.sign(mean_added(regions, colour, 1)) == sign


def test_bad_settings():
    for name in ("weight", "neutral", "reach"):
        with pytest.raises(ConfigError, match=rf"^{name} = -1"):
            BorderColours(**{name: -1})
