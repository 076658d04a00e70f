import numpy as np
from PIL import Image

from scenefw.export.masks import write_masks


def test_ids_come_back_as_they_were(tmp_path):
    ids = np.array([[0, 1, 2], [300, 0, 65535]], np.int32)
    write_masks(tmp_path / "masks.png", ids)
    with Image.open(tmp_path / "masks.png") as image:
        assert image.mode == "I;16"
        np.testing.assert_array_equal(np.asarray(image), ids)
    assert [path.name for path in tmp_path.iterdir()] == ["masks.png"]
