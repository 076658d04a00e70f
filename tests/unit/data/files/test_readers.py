import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays
from PIL import Image
from tests.unit.data import damaged

from scenefw.core.errors import InputError
from scenefw.data.files.intrinsics import read_calibration
from scenefw.data.files.readers import (
    decode_labels,
    find_images,
    read_frame,
    read_frames,
    read_labels,
)

K = np.array([[60.0, 0, 19.5], [0, 61.0, 14.5], [0, 0, 1]])
DEPTH = np.linspace(600, 900, 30 * 40).reshape(30, 40).astype(np.uint16)


def save_npz(folder, name="view.npz", **changes):
    content = {"depth_mm": DEPTH, "K": K} | changes
    np.savez(folder / name, **{k: v for k, v in content.items() if v is not None})
    return folder / name


def save_png(folder, name="depth.png", values=DEPTH):
    Image.fromarray(values).save(folder / name)
    return folder / name


def one_line(error):
    assert "\n" not in str(error.value)
    return str(error.value)


def test_npz_in_millimetres_and_metres(tmp_path):
    first = read_frame(save_npz(tmp_path))
    metres = DEPTH.astype(np.float64) / 1000
    second = read_frame(save_npz(tmp_path, "metres.npz", depth_mm=None, depth=metres))
    np.testing.assert_allclose(first.depth, metres, rtol=1e-6)
    np.testing.assert_allclose(second.depth, metres, rtol=1e-6)
    assert first.depth.dtype == second.depth.dtype == np.float32
    camera = first.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (60, 61, 19.5, 14.5)
    assert (camera.width, camera.height) == (40, 30)
    assert first.name == "view"


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_colour_lies_beside(tmp_path, suffix):
    path = save_npz(tmp_path)
    colour = np.full((30, 40, 3), 200, dtype=np.uint8)
    Image.fromarray(colour).save(tmp_path / f"view.rgb.{suffix}")
    frame = read_frame(path)
    np.testing.assert_allclose(frame.colour, colour, atol=3)
    assert frame.labels is None


def test_labels_of_another_size_are_an_error(tmp_path):
    path = save_npz(tmp_path, label=np.ones((10, 10), dtype=np.uint8))
    with pytest.raises(InputError, match=r"labels of view.npz has shape \(10, 10\)"):
        read_frame(path)


def test_labels_are_decoded():
    coded = np.array([[0, 1, 9], [20, 31, 30], [52, 20, 0]], dtype=np.uint8)
    expected = [[-1, 0, 0], [1, 2, 2], [3, 1, -1]]
    np.testing.assert_array_equal(decode_labels(coded), expected)


@given(arrays(np.uint8, (6, 7)))
def test_decoded_labels_keep_objects_apart(coded):
    labels = decode_labels(coded)
    assert ((labels == -1) == (coded == 0)).all()
    assert ((labels == 0) == ((coded > 0) & (coded < 10))).all()
    objects = labels > 0
    pairs = set(zip(labels[objects].tolist(), (coded[objects] // 10).tolist(), strict=True))
    assert len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})
    assert {a for a, _ in pairs} == set(range(1, len(pairs) + 1))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("depth.json", json.dumps({"fx": 60, "fy": 61, "cx": 19.5, "cy": 14.5})),
        ("intrinsics.json", json.dumps({"K": K.tolist()})),
        ("camera.yaml", "camera_matrix:\n  rows: 3\n  data: [60, 0, 19.5, 0, 61, 14.5, 0, 0, 1]"),
        ("depth.yml", "{cam_K: [60, 0, 19.5, 0, 61, 14.5, 0, 0, 1]}"),
        ("intrinsics.txt", "60 61 19.5 14.5"),
        ("K.txt", "60, 0, 19.5\n0, 61, 14.5\n0, 0, 1\n"),
    ],
)
def test_png_with_intrinsics_beside(tmp_path, name, text):
    path = save_png(tmp_path)
    (tmp_path / name).write_text(text)
    frame = read_frame(path)
    np.testing.assert_allclose(frame.camera.matrix, K)
    np.testing.assert_allclose(frame.depth, DEPTH / 1000, rtol=1e-6)


def test_given_intrinsics_and_depth_scale(tmp_path):
    path = save_png(tmp_path, values=(DEPTH * 5).astype(np.uint16))
    other = tmp_path / "elsewhere" / "camera.txt"
    other.parent.mkdir()
    other.write_text("60 61 19.5 14.5")
    frame = read_frame(path, intrinsics=other, depth_scale=0.0002)
    np.testing.assert_allclose(frame.depth, DEPTH / 1000, rtol=1e-5)


def test_the_depth_scale_of_npz_counts_for_whole_numbers_alone(tmp_path):
    path = tmp_path / "view.npz"
    np.savez(path, depth=(DEPTH * 5).astype(np.uint16), K=K)
    np.testing.assert_allclose(read_frame(path, depth_scale=0.0002).depth, DEPTH / 1000, rtol=1e-5)
    np.savez(path, depth_mm=DEPTH, K=K)
    with pytest.raises(InputError, match=r"^depth_scale = 0\.0002 changes nothing for view\.npz"):
        read_frame(path, depth_scale=0.0002)


@pytest.mark.parametrize("name", ["view.npz", "view.npy"])
def test_a_depth_scale_of_metres_is_refused(tmp_path, name):
    metres = (DEPTH / 1000).astype(np.float32)
    np.savez(tmp_path / "view.npz", depth=metres, K=K)
    np.save(tmp_path / "view.npy", metres)
    np.savetxt(tmp_path / "K.txt", K)
    np.testing.assert_array_equal(read_frame(tmp_path / name).depth, metres)
    with pytest.raises(InputError, match=f"^depth_scale = 0.0002 changes nothing for {name}: "):
        read_frame(tmp_path / name, depth_scale=0.0002)


@pytest.mark.parametrize("values", [DEPTH, (DEPTH / 1000).astype(np.float32)])
def test_npy(tmp_path, values):
    np.save(tmp_path / "scan.npy", values)
    (tmp_path / "scan.json").write_text(json.dumps({"K": K.ravel().tolist()}))
    np.testing.assert_allclose(read_frame(tmp_path / "scan.npy").depth, DEPTH / 1000, rtol=1e-6)


def test_folder_is_read_in_order_without_colour_images(tmp_path):
    for name in ("b.npz", "a.npz"):
        save_npz(tmp_path, name)
    Image.fromarray(np.zeros((30, 40, 3), dtype=np.uint8)).save(tmp_path / "a.rgb.png")
    assert [frame.name for frame in read_frames(tmp_path)] == ["a", "b"]
    assert [path.name for path in find_images(tmp_path.parent / tmp_path.name)] == [
        "a.npz",
        "b.npz",
    ]


def test_folder_of_folders(tmp_path):
    for group in ("one", "two"):
        (tmp_path / group).mkdir()
        save_npz(tmp_path / group)
    assert len(find_images(tmp_path)) == 2


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"K": None}, "no intrinsics"),
        ({"K": np.ones((3, 4))}, "hold 12 numbers"),
        ({"K": K * np.nan}, "fx = nan"),
        ({"K": np.array("K.txt")}, "aren't numbers .*; give a 3 x 3 matrix K"),
        ({"K": K + 0j}, "are complex numbers; give a 3 x 3 matrix K"),
        ({"instances": np.full((30, 40), "a")}, "instances of .* is of <U1; give whole numbers"),
        ({"label": DEPTH + np.nan}, "label of .* is of float64; give whole numbers"),
        ({"K": K * 10}, "outside the image of 40 x 30"),
        ({"depth_mm": None}, "holds K, no depth; store depth_mm"),
        ({"depth_mm": DEPTH / 1e6}, "metres given as millimetres"),
        ({"depth_mm": None, "depth": DEPTH}, "millimetres given as metres.*run.depth_scale=0.001"),
        ({"depth_mm": DEPTH * 1000.0}, "micrometres given as millimetres.*depth_mm is in"),
        ({"depth_mm": DEPTH[None]}, r"shape \(1, 30, 40\)"),
    ],
)
def test_bad_npz_is_one_line(tmp_path, changes, words):
    path = save_npz(tmp_path, **changes)
    with pytest.raises(InputError, match=words) as error:
        read_frame(path)
    assert "view.npz" in one_line(error)


def test_rgb_beside_depth_is_treated_as_a_picture_is(tmp_path):
    rgba = np.random.default_rng(0).integers(0, 255, (30, 40, 4), np.uint8)
    np.testing.assert_array_equal(read_frame(save_npz(tmp_path, rgb=rgba)).colour, rgba[..., :3])
    frame = read_frame(save_npz(tmp_path, rgb=np.zeros((60, 80, 3), np.uint8)))
    assert frame.colour is None
    [note] = frame.notes
    assert note.startswith("colour rgb is left out: it has 80 x 60 pixels, depth 40 x 30")


def test_missing_empty_unknown_and_truncated(tmp_path):
    with pytest.raises(InputError, match="no file or folder"):
        read_frames(tmp_path / "nothing")
    with pytest.raises(InputError, match="no depth image in"):
        read_frames(tmp_path)
    with pytest.raises(InputError, match="is a folder; give one of its depth images"):
        read_frame(tmp_path)
    (tmp_path / "view.obj").write_text("?")
    with pytest.raises(InputError, match=r"unknown format '\.obj'"):
        read_frames(tmp_path / "view.obj")
    path = save_npz(tmp_path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match="cannot read") as error:
        read_frame(path)
    one_line(error)
    path = save_png(tmp_path)
    (tmp_path / "depth.json").write_text(json.dumps({"K": K.tolist()}))
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(InputError, match="cannot read") as error:
        read_frame(path)
    one_line(error)


def test_colour_image_is_no_depth(tmp_path):
    path = save_png(tmp_path, values=np.zeros((30, 40, 3), dtype=np.uint8))
    with pytest.raises(InputError, match="mode RGB"):
        read_frame(path)


def test_png_without_intrinsics_says_where_to_put_them(tmp_path):
    with pytest.raises(
        InputError, match=r"put depth\.json .* beside it, or give run\.intrinsics=PATH"
    ):
        read_frame(save_png(tmp_path))


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.json", "{", "cannot read intrinsics"),
        ("a.json", '{"f": 1}', r"keys: f"),
        ("a.json", "[1, 2, 3]", "hold 3 numbers"),
        ("a.yaml", "K: [a, b]", "cannot read intrinsics"),
        ("a.yaml", "K: [1", "cannot read intrinsics"),
        ("a.txt", "fx fy", "cannot read intrinsics"),
        ("a.xml", "", "unknown intrinsics format '.xml'"),
    ],
)
def test_bad_intrinsics_are_one_line(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as error:
        read_calibration(tmp_path / name)
    one_line(error)


def test_all_real_images_are_read(real_data):
    frames = {frame.name: frame for frame in read_frames(real_data / "real")}
    index = json.loads((real_data / "real" / "index.json").read_text())
    assert index
    for item in index:
        frame = frames[item["name"]]
        assert frame.depth.shape == tuple(item["shape"])
        beside = (real_data / "real" / item["group"]).glob(f"{item['name']}.rgb.*")
        assert (frame.colour is not None) == any(beside)
        if "label" in item["has"]:
            assert frame.labels is not None
            assert frame.labels.max() == item["n_objects"]


@pytest.mark.parametrize("name", ["a.npz", "a.npy"])
def test_text_is_no_file_of_arrays(tmp_path, name):
    """numpy takes it for a pickle, and says how to load it all the same."""
    (tmp_path / name).write_text("just words")
    with pytest.raises(InputError, match=rf"{name}: it is not a file of NumPy arrays") as caught:
        read_frame(tmp_path / name)
    assert "pickle" not in str(caught.value)


def test_images_come_in_the_order_of_their_numbers(tmp_path):
    for number in (1, 2, 10):
        save_npz(tmp_path, f"view_{number}.npz")
    assert [path.stem for path in find_images(tmp_path)] == ["view_1", "view_2", "view_10"]
    assert [frame.name for frame in read_frames(tmp_path)] == ["view_1", "view_2", "view_10"]


@pytest.mark.parametrize("kind", damaged.KINDS)
def test_damaged_archives_are_one_line(tmp_path, kind):
    path = damaged.write(tmp_path / "view.npz", kind, {"depth_mm": DEPTH, "K": K, "label": DEPTH})
    for read in (read_frame, read_labels):
        with pytest.raises(InputError, match="cannot read") as error:
            read(path)
        said = one_line(error)
        pickled = kind == "pickled"
        assert ("pickled objects, which are never loaded" in said) == pickled
        assert ("is the file complete?" in said) != pickled


def test_pictures_too_large_to_be_true_are_one_line(tmp_path, monkeypatch):
    save_png(tmp_path)
    (tmp_path / "intrinsics.txt").write_text("\n".join(" ".join(map(str, row)) for row in K))
    Image.fromarray(np.zeros((30, 40, 3), np.uint8)).save(tmp_path / "depth.rgb.png")
    assert find_images(tmp_path) == [tmp_path / "depth.png"]
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(InputError, match=r"cannot read .*depth\.png") as error:
        read_frame(tmp_path / "depth.png")
    one_line(error)
    with pytest.raises(InputError, match="no depth image in"):
        find_images(tmp_path)


def test_a_device_is_no_image():
    with pytest.raises(InputError, match="/dev/null is neither a file nor a folder"):
        read_frames("/dev/null")


@pytest.mark.parametrize(
    ("colour", "said"),
    [
        (np.zeros((30, 40, 2), np.uint8), r"colour of view\.npz has shape \(30, 40, 2\)"),
        (np.zeros((30, 40, 3)), r"colour of view\.npz is of float64"),
        (np.zeros((30, 40), np.uint8), r"colour of view\.npz has shape \(30, 40\)"),
    ],
)
def test_colour_of_an_archive_is_checked_as_that_of_an_array(tmp_path, colour, said):
    with pytest.raises(InputError, match=said):
        read_frame(save_npz(tmp_path, rgb=colour))


SENSOR = (0.08, -0.05, 0.001, -0.001, 0.02)  # k1 k2 p1 p2 k3
FOUR = {"fx": 60.0, "fy": 61.0, "cx": 19.5, "cy": 14.5}


@pytest.mark.parametrize(
    "words",
    [
        {"distortion": {"k1": 0.08, "k2": -0.05, "k3": 0.02, "p1": 0.001, "p2": -0.001}},
        {"distortion": {"model": "brown", "p2": -0.001, "p1": 0.001, "k1": 0.08, "k2": -0.05,
                        "k3": 0.02}},
        {"distCoef": SENSOR},
        {"dist": SENSOR},
        {"distortion": "0.08 -0.05, 0.001 -0.001 0.02"},
        {"distortion_model": "plumb_bob", "D": SENSOR},
        {"model": "Intel RealSense D435", "coeffs": SENSOR},
        {"camera_model": "pinhole", "distortion_model": "radtan", "D": SENSOR},
        {"model": "OPENCV", "k1": 0.08, "k2": -0.05, "k3": 0.02, "p1": 0.001, "p2": -0.001},
    ],
)  # fmt: skip
def test_a_lens_is_read_by_the_names_of_its_coefficients(tmp_path, words):
    (tmp_path / "K.json").write_text(json.dumps({**FOUR, **words}))
    assert read_calibration(tmp_path / "K.json").lens.coefficients == (*SENSOR, 0, 0, 0)


def test_coefficients_without_the_first_make_a_lens(tmp_path):
    (tmp_path / "K.json").write_text(json.dumps({**FOUR, "k1": None, "p1": 0.01}))
    assert read_calibration(tmp_path / "K.json").lens.coefficients == (0, 0, 0.01, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        *(
            ({"distortion_model": model, "D": SENSOR}, f"unknown model .{model}")
            for model in ("fov", "omni", "double_sphere", "eucm", "ftheta", "division")
        ),
        (
            {"camera_model": "omni", "distortion_model": "radtan", "D": SENSOR},
            "unknown model .omni",
        ),
        ({"camera_model": "ds", "D": SENSOR}, "unknown model .ds"),
        ({"model": "distortion.inverse_brown_conrady", "coeffs": SENSOR}, "unknown model"),
        ({"radial_distortion": [0.1, -0.2]}, "radial_distortion of .* isn't read"),
        ({"distortion": {"radial": [0.1, -0.2]}}, "distortion: radial of .* isn't read"),
        ({"distortion": "strong"}, "holds no numbers"),
    ],
)
def test_a_lens_that_is_not_read_is_refused(tmp_path, words, message):
    (tmp_path / "K.json").write_text(json.dumps({**FOUR, **words}))
    with pytest.raises(InputError, match=message):
        read_calibration(tmp_path / "K.json")


def test_a_lens_without_distortion_is_none(tmp_path):
    for words in ({"distortion_model": "omni", "D": [0.0] * 5}, {"radial_distortion": [0, 0]}):
        (tmp_path / "K.json").write_text(json.dumps({**FOUR, **words}))
        assert read_calibration(tmp_path / "K.json").lens is None


def test_what_an_npz_says_beside_its_matrix_counts(tmp_path):
    values = (DEPTH / 0.8).astype(np.uint16)
    read = read_frame(save_npz(tmp_path, depth_mm=None, depth=values, depth_scale=0.0008))
    np.testing.assert_allclose(read.depth, 0.0008 * values, rtol=1e-6)
    with pytest.raises(InputError, match="its intrinsics are of 80 x 60"):
        read_frame(save_npz(tmp_path, width=80, height=60))
    assert "undistorted" in read_frame(save_npz(tmp_path, D=SENSOR)).notes[0]
    with pytest.raises(InputError, match=r"depth_mm and depth of .* differ; keep one"):
        read_frame(save_npz(tmp_path, depth=DEPTH / 1500))
    for depth in (DEPTH / 1000, DEPTH):
        np.testing.assert_allclose(read_frame(save_npz(tmp_path, depth=depth)).depth, DEPTH / 1000)


def test_a_damaged_colour_image_is_named(tmp_path):
    path = save_npz(tmp_path)
    (tmp_path / "view.rgb.jpg").write_bytes(b"\xff\xd8\xff\xe0 no picture")
    with pytest.raises(InputError, match=r"colour image .*view\.rgb\.jpg"):
        read_frame(path)
