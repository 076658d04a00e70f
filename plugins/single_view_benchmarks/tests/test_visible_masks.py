"""Labels from masks of a BOP data set."""

import numpy as np
import pytest
from PIL import Image

from scenefw.core.errors import ConfigError, LabelsError
from scenefw_single_view_benchmarks.visible_masks import VisibleMasks


def scene(root, *masks, name="000003"):
    """A BOP scene with these masks, and its image."""
    (root / "mask_visib").mkdir(parents=True, exist_ok=True)
    for number, mask in enumerate(masks):
        file = root / "mask_visib" / f"{name}_{number:06d}.png"
        Image.fromarray(np.asarray(mask, dtype=np.uint8) * 255).save(file)
    return root / "depth" / f"{name}.png"


def block(rows, columns, size=(48, 64)):
    mask = np.zeros(size, dtype=bool)
    mask[rows[0] : rows[1], columns[0] : columns[1]] = True
    return mask


def test_each_mask_is_an_object(tmp_path):
    first, second = block((0, 10), (0, 10)), block((20, 40), (30, 50))
    labels = VisibleMasks().of(scene(tmp_path, first, second))
    np.testing.assert_array_equal(labels, first + 2 * second)
    assert labels.dtype == np.int32


def test_numbers_have_no_gaps_and_what_is_hardly_seen_is_unknown(tmp_path):
    """A pixel of an image 64 wide is 100 of one 640 wide."""
    nothing, speck = np.zeros((48, 64), bool), block((0, 1), (0, 2))
    large = block((20, 40), (30, 50))
    image = scene(tmp_path, nothing, speck, large)
    np.testing.assert_array_equal(VisibleMasks(300).of(image), large.astype(int) - speck)
    np.testing.assert_array_equal(VisibleMasks(150).of(image), speck + 2 * large)
    np.testing.assert_array_equal(VisibleMasks(0).of(image), speck + 2 * large)


def test_masks_of_other_images_and_missing_ones(tmp_path):
    scene(tmp_path, block((0, 10), (0, 10)))
    assert VisibleMasks().of(tmp_path / "depth" / "000004.png") is None
    assert VisibleMasks().of(tmp_path / "rgb" / "000003.png") is None


def test_damaged_masks(tmp_path):
    image = scene(tmp_path, block((0, 10), (0, 10)), block((0, 10), (0, 10), (24, 32)))
    with pytest.raises(LabelsError, match="another size"):
        VisibleMasks().of(image)
    (tmp_path / "mask_visib" / "000003_000001.png").write_bytes(b"no picture")
    with pytest.raises(LabelsError, match=r"cannot read .*000003_000001"):
        VisibleMasks().of(image)


def test_bad_settings():
    with pytest.raises(ConfigError, match=r"^smallest = "):
        VisibleMasks(-1)
