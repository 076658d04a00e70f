"""Compressed depth in bags."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from plugins.recordings.tests.bag_messages import (
    COLOUR,
    HEADER,
    HOLES,
    INVERSE,
    compressed,
    png_of,
    rvl_of,
    written,
)

from scenefw.core.errors import InputError
from scenefw_recordings.bags import Bag
from scenefw_recordings.rvl import decode_rvl


@pytest.mark.parametrize(
    ("form", "data", "tolerance"),
    [
        ("16UC1; compressedDepth png", HEADER + png_of(HOLES), 1e-6),
        ("16UC1; compressedDepth", HEADER + png_of(HOLES), 1e-6),  # before 2020
        ("16UC1; png compressed ", png_of(HOLES), 1e-6),  # of image_transport's plain plugin
        ("png", png_of(HOLES), 1e-6),
        ("16UC1; compressedDepth rvl", HEADER + rvl_of(HOLES), 1e-6),
        ("32FC1; compressedDepth png", HEADER + png_of(INVERSE), 2e-3),
        ("32FC1; compressedDepth", HEADER + png_of(INVERSE), 2e-3),
        ("32FC1; compressedDepth rvl", HEADER + rvl_of(INVERSE), 2e-3),
    ],
)
def test_depth_is_compressed_in_many_ways(tmp_path, form, data, tolerance):
    [frame] = Bag(written(tmp_path / "r", compressed(form, data, colour=True))).frames()
    assert np.allclose(frame.depth, HOLES / 1000, atol=tolerance)
    assert ((frame.depth > 0) == (HOLES > 0)).all()
    assert np.array_equal(frame.colour, COLOUR)


@pytest.mark.parametrize(
    ("form", "data", "said"),
    [
        ("16UC1; compressedDepth rvl", HEADER + rvl_of(HOLES)[:40], "is damaged"),
        ("16UC1; jpeg compressed", b"\xff\xd8\xff" + bytes(40), "expected depth as PNG or RVL"),
        ("16UC1; compressedDepth png", HEADER + png_of(HOLES)[:60], "is damaged"),
        ("rgb8; png compressed", png_of(COLOUR), "pictures of colour"),
        ("8UC1; png compressed", png_of(COLOUR[..., 0]), "8 bits per pixel"),
    ],
)
def test_what_is_no_compressed_depth_is_one_line(tmp_path, form, data, said):
    bag = written(tmp_path / "r", compressed(form, data))
    with pytest.raises(InputError, match=said) as caught:
        list(Bag(bag).frames())
    assert "\n" not in str(caught.value)


@given(values=arrays(np.uint16, st.integers(1, 60), elements=st.sampled_from([0, 0, 1, 9, 65535])))
def test_rvl_is_the_published_codec(values):
    data = rvl_of(values[None])
    assert np.array_equal(decode_rvl(data[8:], values.size), values)


@given(data=st.binary(max_size=80), pixels=st.integers(0, 200))
def test_damaged_rvl_is_told(data, pixels):
    with contextlib.suppress(ValueError):
        assert decode_rvl(data, pixels).shape == (pixels,)
