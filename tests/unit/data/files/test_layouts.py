import json

import numpy as np
import pytest
from PIL import Image
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.data.files.readers import find_images, read_frame

CAMERA = camera_at(size=(80, 60))
DEPTH = frame_of(CAMERA).depth
RED = np.full((60, 80, 3), (255, 0, 0), np.uint8)


def depth_image(path, scale):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.rint(DEPTH / scale).astype(np.uint16)).save(path)
    return path


def colour_image(path, colour=RED):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(colour).save(path)


def check(frame, tolerance):
    np.testing.assert_allclose(frame.depth, DEPTH, atol=tolerance)
    np.testing.assert_allclose(frame.camera.matrix, CAMERA.matrix)
    np.testing.assert_array_equal(frame.colour, RED)


def test_a_bop_scene_tells_units_and_intrinsics(tmp_path):
    image = depth_image(tmp_path / "depth" / "000007.png", 0.0001)
    colour_image(tmp_path / "rgb" / "000007.png")
    Image.fromarray(np.uint8(DEPTH > 1)).save(tmp_path / "mask.png")
    camera = {"cam_K": CAMERA.matrix.ravel().tolist(), "depth_scale": 0.1}
    (tmp_path / "scene_camera.json").write_text(json.dumps({"7": camera}))
    assert find_images(tmp_path) == [image]
    check(read_frame(image), 0.0001)
    assert read_frame(image, depth_scale=0.0002).depth.max() == pytest.approx(2 * DEPTH.max(), 1e-3)
    latin = json.dumps({"7": camera | {"site": "Zürich"}}, ensure_ascii=False)
    (tmp_path / "scene_camera.json").write_bytes(latin.encode("latin-1"))
    check(read_frame(image), 0.0001)
    others = [json.dumps({"7": camera | {"depth_scale": scale}}) for scale in (0, -1)]
    for wrong in ("{}", "[", json.dumps({"7": {"cam_K": [1, 2]}}), *others):
        (tmp_path / "scene_camera.json").write_text(wrong)
        with pytest.raises(InputError, match=r"does not tell the camera of 000007\.png"):
            read_frame(image)


def test_a_tum_sequence_tells_units_and_colour_by_time(tmp_path):
    image = depth_image(tmp_path / "depth" / "10.05.png", 1 / 5000)
    colour_image(tmp_path / "rgb" / "10.04.png")
    colour_image(tmp_path / "rgb" / "10.00.png", 0 * RED)
    (tmp_path / "depth.txt").write_text("# depth\n10.05 depth/10.05.png\n")
    (tmp_path / "rgb.txt").write_text("10.00 rgb/10.00.png\n10.04 rgb/10.04.png\n")
    np.savetxt(tmp_path / "intrinsics.txt", CAMERA.matrix)
    check(read_frame(image), 0.0002)
    (tmp_path / "rgb.txt").write_text("10.00 rgb/10.00.png\n")
    assert read_frame(image).colour is None
    (tmp_path / "rgb.txt").write_text("now rgb/10.00.png\n")
    with pytest.raises(InputError, match="line without a timestamp"):
        read_frame(image)


def test_an_rgbd_folder_has_intrinsics_above_and_colour_beside(tmp_path):
    image = depth_image(tmp_path / "depth" / "a.png", 0.001)
    colour_image(tmp_path / "rgb" / "a.png")
    np.savetxt(tmp_path / "K.txt", CAMERA.matrix)
    check(read_frame(image), 0.001)
