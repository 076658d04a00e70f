import json

import numpy as np
import pytest

from scenefw.core.errors import InputError
from scenefw.core.types import Camera
from scenefw.data.files.arrays import frame_of
from scenefw.data.files.intrinsics import camera_from_matrix, read_calibration
from scenefw.data.files.readers import read_frame

K = np.array([[60.0, 0, 20], [0, 61, 15], [0, 0, 1]])
DEPTH = np.full((30, 40), 0.5, np.float32)
SIZED = {"width": 40, "height": 30, "K": K.ravel().tolist()}


def test_a_transposed_matrix_is_named():
    with pytest.raises(InputError, match=r"last row, not 0 0 1; K looks transposed"):
        camera_from_matrix(K.T, 30, 40, "view.png")
    wrong = K.copy()
    wrong[2, 2] = 2
    with pytest.raises(InputError, match=r"not 0 0 1; give a 3 x 3 matrix"):
        camera_from_matrix(wrong, 30, 40, "view.png")


def test_a_byte_order_mark_is_no_number(tmp_path):
    path = tmp_path / "K.json"
    path.write_bytes(b"\xef\xbb\xbf" + json.dumps(SIZED).encode())
    np.testing.assert_array_equal(read_calibration(path).matrix, K)
    path = tmp_path / "K.txt"
    path.write_bytes(b"\xef\xbb\xbf60 61 20 15")
    np.testing.assert_array_equal(read_calibration(path).matrix, K)


@pytest.mark.parametrize("given", [Camera(40, 30, 60, 61, 20, 15), SIZED, "file", "beside"])
def test_a_depth_image_of_another_size_than_its_intrinsics_is_named(tmp_path, given):
    def read(depth):
        if not isinstance(given, str):
            return frame_of(depth, given, name="view")
        np.save(tmp_path / "view.npy", depth)
        (tmp_path / "view.json").write_text(json.dumps(SIZED))
        known = tmp_path / "view.json" if given == "file" else None
        return read_frame(tmp_path / "view.npy", intrinsics=known)

    np.testing.assert_allclose(read(DEPTH).camera.matrix, K)
    with pytest.raises(InputError, match=r"30 x 40 pixels, .* 40 x 30; is the depth transposed\?"):
        read(DEPTH.T.copy())
    with pytest.raises(InputError, match=r"80 x 60 pixels, .* 40 x 30; give the intrinsics of"):
        read(np.kron(DEPTH, np.ones((2, 2), np.float32)))


@pytest.mark.parametrize("place", [(0, 1), (1, 0)])
def test_a_skew_is_refused_and_rounding_is_not(place):
    skewed = K.copy()
    skewed[place] = 1e-5
    frame_of(DEPTH, skewed)
    skewed[place] = 5
    with pytest.raises(InputError, match=r"^intrinsics of image have a skew .*; rectify the image"):
        frame_of(DEPTH, skewed)


@pytest.mark.parametrize(
    "size",
    [
        {"resolution": [80, 60]},
        {"image_size": [80, 60]},
        {"resolution": {"width": 80, "height": 60}},
    ],
)
def test_the_size_of_the_image_under_other_names(size):
    with pytest.raises(InputError, match=r"its intrinsics are of 80 x 60"):
        frame_of(DEPTH, {"K": K, **size}, name="view")


@pytest.mark.parametrize("key", ["depth_units", "png_depth_scale", "DepthMapFactor", "depthScale"])
def test_the_unit_of_depth_under_other_names(key):
    depth = np.rint(DEPTH * 5000).astype(np.uint16)
    scale = 5000 if key == "DepthMapFactor" else 1 / 5000
    np.testing.assert_allclose(frame_of(depth, {"K": K, key: scale}).depth, DEPTH, atol=1e-4)


def test_a_region_of_an_image_shifts_its_intrinsics():
    whole = {"width": 80, "height": 60, "K": K}
    region = {"x_offset": 8, "y_offset": 6, "width": 40, "height": 30}
    camera = frame_of(DEPTH, {**whole, "roi": region}, name="view").camera
    assert (camera.fx, camera.cx, camera.cy) == (K[0, 0], K[0, 2] - 8, K[1, 2] - 6)
    unused = dict.fromkeys(region, 0)
    assert frame_of(DEPTH, {"K": K, "roi": unused}, name="view").camera.cx == K[0, 2]


def test_a_document_of_yaml_may_end(tmp_path):
    path = tmp_path / "camera_info.yaml"
    path.write_text(f"width: 40\nheight: 30\nK: {K.ravel().tolist()}\n---\n")
    np.testing.assert_array_equal(read_calibration(path).matrix, K)
    path.write_text(path.read_text() + "K: [1]\n")
    with pytest.raises(InputError, match="holds 2 documents of YAML; give one"):
        read_calibration(path)


@pytest.mark.parametrize("scale", ["0.0002", 0.0002])
def test_a_unit_in_text_is_the_same_unit(scale):
    depth = np.rint(DEPTH * 5000).astype(np.uint16)
    np.testing.assert_allclose(
        frame_of(depth, {"K": K, "depth_scale": scale}).depth, DEPTH, atol=1e-4
    )
    in_millimetres = np.rint(DEPTH * 1000).astype(np.uint16)
    np.testing.assert_allclose(
        frame_of(in_millimetres, {"K": K, "depth_unit": "mm"}).depth, DEPTH, atol=1e-3
    )


@pytest.mark.parametrize("scale", ["furlongs", [0.001], {"value": 1}])
def test_a_unit_that_is_none_is_one_line(scale):
    depth, calibration = np.full(DEPTH.shape, 500, np.uint16), {"K": K, "depth_scale": scale}
    with pytest.raises(InputError, match=r"depth_scale of view is .*; expected metres per unit"):
        frame_of(depth, calibration, name="view")
