from functools import partial

import numpy as np
import pytest
from PIL import Image
from tests.unit.perception.synthetic import camera_at
from tests.unit.perception.synthetic import frame_of as synthetic_frame

from scenefw.core.errors import ConfigError, EmptyImageError, InputError
from scenefw.data.files.arrays import frame_of, mask_of, read_mask
from scenefw.data.files.readers import read_frame

CAMERA = camera_at(size=(80, 60))
DEPTH = synthetic_frame(CAMERA).depth
K = CAMERA.matrix


@pytest.mark.parametrize("dtype", [np.uint16, np.int32, np.float32, np.float64])
def test_an_array_is_the_frame_of_its_file(tmp_path, dtype):
    depth = DEPTH if np.issubdtype(dtype, np.floating) else np.rint(DEPTH * 1000)
    depth = depth.astype(dtype)
    np.save(tmp_path / "image.npy", depth)
    np.savetxt(tmp_path / "K.txt", K)
    read, given = read_frame(tmp_path / "image.npy"), frame_of(depth, K)
    np.testing.assert_array_equal(read.depth, given.depth)
    assert given.depth.dtype == np.float32
    np.testing.assert_array_equal(read.camera.matrix, given.camera.matrix)


def test_whole_millimetres_are_the_same_from_every_source(tmp_path):
    depth = np.arange(500, 500 + 60 * 80, dtype=np.uint16).reshape(60, 80)
    np.savez(tmp_path / "image.npz", depth_mm=depth, K=K)
    np.save(tmp_path / "image.npy", depth)
    Image.fromarray(depth).save(tmp_path / "image.png")
    np.savetxt(tmp_path / "K.txt", K)
    given = frame_of(depth, K).depth
    np.testing.assert_array_equal(given, (depth / 1000).astype(np.float32))
    for suffix in ("npz", "npy", "png"):
        np.testing.assert_array_equal(read_frame(tmp_path / f"image.{suffix}").depth, given)


@pytest.mark.parametrize("dtype", [bool, np.complex64, "<U5"])
def test_depth_of_no_numbers_is_refused_from_every_source(tmp_path, dtype):
    depth = DEPTH.astype(dtype)
    np.savez(tmp_path / "metres.npz", depth=depth, K=K)
    np.savez(tmp_path / "millimetres.npz", depth_mm=depth, K=K)
    np.save(tmp_path / "image.npy", depth)
    np.savetxt(tmp_path / "K.txt", K)
    reads = [lambda: frame_of(depth, K)] + [
        partial(read_frame, tmp_path / name)
        for name in ("metres.npz", "millimetres.npz", "image.npy")
    ]
    for read in reads:
        with pytest.raises(InputError, match="; give floats in metres, or whole numbers"):
            read()


def test_nan_and_infinity_are_no_measurement():
    depth = DEPTH.copy()
    depth[0, 0], depth[0, 1], depth[0, 2] = np.nan, np.inf, -1
    assert (frame_of(depth, K).depth[0, :3] == 0).all()


@pytest.mark.parametrize(
    "given",
    [
        K.tolist(),
        CAMERA,
        {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy},
        {"K": K},
        (CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy),
        K.ravel(),
    ],
    ids=["rows", "camera", "numbers", "named", "four", "nine"],
)
def test_intrinsics_in_any_form(given):
    np.testing.assert_allclose(frame_of(DEPTH, given).camera.matrix, K)


def colour(*shape):
    return np.zeros(shape, np.uint8)


@pytest.mark.parametrize(
    ("depth", "intrinsics", "options", "words"),
    [
        (DEPTH[None], K, {}, r"shape \(1, 60, 80\)"),
        (DEPTH * 1000, K, {}, "millimetres given as metres"),
        (np.zeros((60, 80), np.uint16), K, {}, "no measurements"),
        (DEPTH > 0, K, {}, "depth of image is of bool"),
        (DEPTH.astype(complex), K, {}, "depth of image is of complex"),
        ([["a"]], K, {}, "depth of image is of <U1"),
        ([[1.0, 2.0], [3.0]], K, {}, "NumPy can't read"),
        (DEPTH, [1, 2, 3], {}, "hold 3 numbers"),
        (DEPTH, "K.txt", {}, "no intrinsics file K.txt"),
        (DEPTH, {"f": 3}, {}, r"no intrinsics in image \(keys: f\)"),
        (DEPTH, [["x"] * 3] * 3, {}, "aren't numbers"),
        (DEPTH, K * (1 + 1j), {}, "complex numbers; give a 3 x 3 matrix"),
        (DEPTH, K * 10, {}, "outside the image of 80 x 60"),
        (DEPTH, np.full((3, 3), np.nan), {}, "fx = nan"),
        (DEPTH, K, {"colour": colour(60, 80)}, "colour with 3 channels"),
        (DEPTH, K, {"colour": np.zeros((60, 80, 3))}, "give uint8"),
        (DEPTH, K, {"depth_scale": 0.001}, "depth_scale = 0.001 changes nothing for image"),
        (DEPTH, K, {"pose": np.eye(3)}, "give a 4 x 4 matrix"),
        (DEPTH, K, {"pose": np.diag([2.0, 1, 1, 1])}, "pose of image"),
    ],
)
def test_what_is_wrong_is_one_line(depth, intrinsics, options, words):
    with pytest.raises(InputError, match=words) as caught:
        frame_of(depth, intrinsics, **options)
    assert "\n" not in str(caught.value)


def test_an_empty_image_can_be_told_apart():
    with pytest.raises(EmptyImageError):
        frame_of(np.full((60, 80), np.nan), K)


def test_a_depth_scale_is_positive():
    with pytest.raises(ConfigError, match="depth_scale = 0"):
        frame_of(np.ones((60, 80), int), K, depth_scale=0)


def test_masks_are_booleans_or_ids():
    inside = np.median(DEPTH) < DEPTH
    np.testing.assert_array_equal(mask_of(inside, DEPTH.shape, "x"), inside)
    ids = np.where(inside, 7, -1)
    np.testing.assert_array_equal(mask_of(ids, DEPTH.shape, "x"), np.where(inside, 7, 0))
    assert mask_of(inside, DEPTH.shape, "x").dtype == bool
    for wrong, words in [
        (inside[1:], "shape"),
        (inside * 1.0, "float64"),
        (inside & False, "no pixel"),
    ]:
        with pytest.raises(InputError, match=words):
            mask_of(wrong, DEPTH.shape, "x")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_masks_of_files_are_regions_or_ids(tmp_path, dtype):
    inside = np.median(DEPTH) < DEPTH
    Image.fromarray((inside * 255).astype(dtype)).save(tmp_path / "region.png")
    region = read_mask(tmp_path / "region.png", DEPTH.shape)
    assert region.dtype == bool
    np.testing.assert_array_equal(region, inside)
    Image.fromarray(np.where(inside, 2, 5).astype(dtype)).save(tmp_path / "ids.png")
    ids = read_mask(tmp_path / "ids.png", DEPTH.shape)
    np.testing.assert_array_equal(ids, np.where(inside, 2, 5))


def test_masks_that_are_none_are_one_line(tmp_path):
    Image.new("RGB", (80, 60)).save(tmp_path / "colour.png")
    (tmp_path / "text.png").write_text("no picture")
    for name, words in [
        ("missing.png", r"no mask .*missing\.png; add it"),
        ("text.png", "cannot read mask"),
        ("colour.png", "mode RGB; give one channel"),
    ]:
        with pytest.raises(InputError, match=words):
            read_mask(tmp_path / name, DEPTH.shape)


@pytest.mark.parametrize("stack", [(3, *DEPTH.shape), (*DEPTH.shape, 3)])
def test_a_stack_of_masks_is_told_how_to_become_one_image(stack):
    with pytest.raises(InputError, match="of several masks make one image, 1 where the first"):
        mask_of(np.ones(stack, bool), DEPTH.shape, "x")


def test_a_file_of_several_pictures_is_no_mask(tmp_path):
    pages = [Image.fromarray(np.full(DEPTH.shape, value, np.uint8)) for value in (1, 2)]
    pages[0].save(tmp_path / "x.tif", save_all=True, append_images=pages[1:])
    with pytest.raises(InputError, match="holds 2 pictures; of several masks make one image"):
        read_mask(tmp_path / "x.tif", DEPTH.shape)


@pytest.mark.parametrize("value", [1, 255, 65535])
@pytest.mark.parametrize("dtype", [np.int32, np.int64, np.uint16])
def test_a_single_mark_of_any_type_says_where_objects_are(value, dtype):
    marked = np.zeros(DEPTH.shape, dtype)
    marked[10:20, 10:20] = value
    np.testing.assert_array_equal(mask_of(marked, DEPTH.shape, "x"), marked > 0)


def test_ids_too_large_for_an_object_keep_their_size():
    ids = np.zeros(DEPTH.shape, np.int64)
    ids[10:20, 10:20], ids[30:40, 10:20] = 2**32 + 1, 3
    assert mask_of(ids, DEPTH.shape, "x").max() == np.iinfo(np.int32).max  # no object 1
