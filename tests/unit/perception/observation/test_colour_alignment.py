"""Colour beside depth: painted scenes with known shifts, and real images."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.data.files.readers import read_frame
from scenefw.perception.observation.colour_alignment import colour_shift


def painted(size, shift, seed=0):
    """Depth of two boxes, and the same in shades with a pattern on everything."""
    frame = frame_of(camera_at(size=size), noise=0.001)
    random = np.random.default_rng(seed)
    shades = np.choose(frame.labels, [90.0, 170.0, 60.0])
    shades += 15 * gaussian_filter(random.normal(size=shades.shape), 2)
    colour = np.repeat(shades.clip(0, 255).astype(np.uint8)[..., None], 3, axis=2)
    return frame.depth, np.roll(colour, shift, (0, 1))


@pytest.mark.parametrize("size", [(320, 240), (640, 480), (1280, 720)])
def test_a_shift_is_found(size):
    step = size[0] // 320
    for rows, columns in ((0, 0), (12 * step, -8 * step), (0, 15 * step)):
        found = colour_shift(*painted(size, (rows, columns)))
        assert abs(found.rows - rows) <= 2 * step
        assert abs(found.columns - columns) <= 2 * step
        assert (found.agreement > 0.8) == (rows == columns == 0)
        assert found.agreement <= 1.0


def test_where_nothing_jumps_or_nothing_is_painted_nothing_is_known():
    depth, colour = painted((320, 240), (0, 0))
    assert colour_shift(np.full_like(depth, 0.8), colour) is None
    assert colour_shift(np.zeros_like(depth), colour) is None
    assert colour_shift(depth, np.full_like(colour, 7)) is None
    assert colour_shift(depth[:30, :30], colour[:30, :30]) is None


def test_borders_of_the_image_are_no_edges():
    depth, colour = painted((320, 240), (0, 0))
    depth[:, :1] = 0.3
    assert colour_shift(depth, colour).agreement > 0.8


def test_real_images_are_aligned_and_moved_ones_are_not(real_data):
    root, agreed, moved = Path(real_data) / "real", [], []
    for file in sorted(root.glob("mosd_learn/*.npz"))[::5] + sorted(root.glob("real*/*.npz"))[::3]:
        frame = read_frame(file)
        (picture,) = file.parent.glob(f"{file.stem}.rgb.*")
        colour = np.asarray(Image.open(picture))
        agreed.append(colour_shift(frame.depth, colour).agreement)
        moved.append(colour_shift(frame.depth, np.roll(colour, (16, 16), (0, 1))).agreement)
    assert min(agreed) > 0.6
    assert np.mean(np.array(moved) < 0.6) > 0.9
