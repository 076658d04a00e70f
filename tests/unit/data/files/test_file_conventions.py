"""What files of other programs say of their images is read, or refused in a line."""

import json

import numpy as np
import pytest
from PIL import Image
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import InputError
from scenefw.core.geometry import quaternion_from_rotation
from scenefw.data.files.arrays import frame_of as frame_of_array
from scenefw.data.files.exr import read_exr
from scenefw.data.files.image_checks import placeholders, unit_of
from scenefw.data.files.intrinsics import read_calibration
from scenefw.data.files.readers import read_frame
from scenefw.data.files.sequences import open_sequence, write_sequence

CAMERA = camera_at(size=(80, 60))
K = CAMERA.matrix
FX, FY, CX, CY = K[0, 0], K[1, 1], K[0, 2], K[1, 2]
DEPTH = frame_of(CAMERA).depth
MILLIMETRES = np.rint(1000 * DEPTH).astype(np.uint16)
FOUR = {"fx": FX, "fy": FY, "cx": CX, "cy": CY}


def image(folder, values=MILLIMETRES, name="depth.png", **intrinsics):
    folder.mkdir(exist_ok=True)
    Image.fromarray(values).save(folder / name)
    if intrinsics:
        (folder / "intrinsics.json").write_text(json.dumps(intrinsics))
    return folder / name


OPENCV_YAML = f"""%YAML:1.0
---
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
"""
ROS_YAML = f"""image_width: 80
image_height: 60
camera_name: depth
camera_matrix: {{rows: 3, cols: 3, data: {K.ravel().tolist()}}}
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0.1, 0, 0, 0, 0]}}
"""
BERKELEY = {f"_{key}": value for key, value in FOUR.items()} | {"_width": 80, "_height": 60}
SCANNET = np.eye(4)
SCANNET[:3, :3] = K


@pytest.mark.parametrize(
    ("name", "text", "size", "has_lens"),
    [
        ("intrinsics.json", json.dumps({"width": 80, "height": 60,
         "intrinsic_matrix": K.T.ravel().tolist()}), (80, 60), False),  # Open3D
        ("intrinsics.json", json.dumps({"K": K.ravel().tolist()}), None, False),
        ("camera.intr", json.dumps(BERKELEY | {"_skew": 0.0, "_frame": "camera"}), (80, 60), False),
        ("intrinsics.json", json.dumps(BERKELEY), (80, 60), False),
        ("camera.yaml", OPENCV_YAML, None, False),
        ("camera.yaml", ROS_YAML, (80, 60), True),
        ("intrinsics.json", json.dumps({"w": 80, "h": 60, "fl_x": FX, "fl_y": FY, "cx": CX,
         "cy": CY, "k1": 0.1}), (80, 60), True),  # nerfstudio
        ("intrinsics.json", json.dumps({"width": 80, "height": 60, "fx": FX, "fy": FY, "ppx": CX,
         "ppy": CY, "model": "distortion.brown_conrady", "coeffs": [0] * 5}), (80, 60), False),
        ("intrinsic_depth.txt", "\n".join(" ".join(map(str, row)) for row in SCANNET), None, False),
    ],
)  # fmt: skip
def test_intrinsics_of_other_programs(tmp_path, name, text, size, has_lens):
    (tmp_path / name).write_text(text)
    calibration = read_calibration(tmp_path / name)
    np.testing.assert_allclose(calibration.matrix, K)
    assert calibration.size == size
    assert (calibration.lens is not None) == has_lens


@pytest.mark.parametrize(
    "text",
    [
        "a: &a [1, 2]\nK: [*a, *a]",
        "!!python/object/apply:os.system ['true']",
        "K: !!opencv-matrix [1, 2]",
    ],
)
def test_yaml_runs_no_code_and_does_not_grow(tmp_path, text):
    (tmp_path / "camera.yaml").write_text(text)
    with pytest.raises(InputError, match="cannot read intrinsics") as caught:
        read_calibration(tmp_path / "camera.yaml")
    assert "\n" not in str(caught.value)


def test_a_pose_is_no_camera(tmp_path):
    pose = CAMERA.T_world_camera
    (tmp_path / "K.txt").write_text("\n".join(" ".join(map(str, row)) for row in pose))
    with pytest.raises(InputError, match="is a pose, no intrinsics"):
        read_calibration(tmp_path / "K.txt")


@pytest.mark.parametrize(
    ("scale", "unit"), [(0.0008, 0.0008), (0.8, 0.0008), (1250, 0.0008), (1, 0.001), (1000, 0.001)]
)
def test_depth_scale_is_read_in_whatever_unit(tmp_path, scale, unit):
    values = np.rint(DEPTH / unit).astype(np.uint16)
    frame = read_frame(image(tmp_path, values, depth_scale=scale, **FOUR))
    np.testing.assert_allclose(frame.depth, DEPTH, atol=unit)
    override = read_frame(tmp_path / "depth.png", depth_scale=2 * unit)
    np.testing.assert_allclose(override.depth, 2 * DEPTH, atol=2 * unit)


@pytest.mark.parametrize("scale", [0.0, -1.0, 1e-7])
def test_a_depth_scale_that_fits_no_unit_is_refused(scale):
    with pytest.raises(InputError, match=r"depth_scale of a is .*expected metres per unit"):
        unit_of(scale, MILLIMETRES, "a")


@pytest.mark.parametrize("size", [(160, 120), (60, 80), (100, 60)])
def test_intrinsics_of_another_size_are_refused(tmp_path, size):
    path = image(tmp_path, width=size[0], height=size[1], **FOUR)
    with pytest.raises(InputError, match=f"80 x 60 pixels, .* are of {size[0]} x {size[1]}; "):
        read_frame(path)


def test_colour_of_another_size_is_left_out_with_a_line(tmp_path):
    path = image(tmp_path, **FOUR)
    Image.fromarray(np.zeros((120, 160, 3), np.uint8)).save(tmp_path / "depth.rgb.png")
    frame = read_frame(path)
    assert frame.colour is None
    [note] = frame.notes
    assert note.startswith("colour depth.rgb.png is left out: it has 160 x 120 pixels, depth 80")


@pytest.mark.parametrize("value", [65535, 10001, 4000])
@pytest.mark.parametrize("holes", [0.02, 0.6])
def test_placeholders_of_files_are_no_measurement(tmp_path, value, holes):
    missing = np.random.default_rng(0).random(DEPTH.shape) < holes
    frame = read_frame(image(tmp_path, np.where(missing, value, MILLIMETRES).astype("u2"), **FOUR))
    np.testing.assert_allclose(frame.depth, np.where(missing, 0, DEPTH), atol=6e-4)
    [note] = frame.notes
    assert note.startswith(f"depth of {value} counts as not measured")


@pytest.mark.parametrize("value", [65.535, 1e10, 10.001])
def test_placeholders_of_floats_are_no_measurement(value):
    missing = np.random.default_rng(0).random(DEPTH.shape) < 0.1
    frame = frame_of_array(np.where(missing, np.float32(value), DEPTH), K)
    np.testing.assert_array_equal(frame.depth, np.where(missing, 0, DEPTH))


def test_a_wall_behind_and_a_flat_table_are_measurements():
    """Many pixels share these depths, too, but others are near them."""
    flat = np.full((60, 80), 0.8, np.float32)
    flat[20:30, 20:40] = 0.6  # an object on a table seen from straight above
    assert placeholders(flat) == []
    wall = np.where(np.arange(80) < 30, np.float32(1.9), DEPTH)
    assert placeholders(wall) == []
    assert frame_of_array(flat, K).notes == ()


def test_a_placeholder_within_the_range_of_a_room():
    rng = np.random.default_rng(0)
    far = np.where(np.arange(80) < 6, 3 + 3 * rng.random((60, 80)), DEPTH).astype(np.float32)
    holes = rng.random(far.shape) < 0.05
    assert placeholders(np.where(holes, np.float32(4.0), far)) == [4.0]
    assert placeholders(far) == []
    steps = np.round(far * 20) / 20  # of disparity
    assert placeholders(np.where(far > 3, steps, far).astype(np.float32)) == []


@pytest.mark.parametrize("dtype", [np.float32, np.uint16])
def test_arrays_may_have_one_channel(tmp_path, dtype):
    values = DEPTH if dtype == np.float32 else MILLIMETRES
    np.testing.assert_allclose(frame_of_array(values[..., None], K).depth, DEPTH, atol=6e-4)
    np.save(tmp_path / "a.npy", values[..., None])
    (tmp_path / "a.json").write_text(json.dumps(FOUR))
    np.testing.assert_allclose(read_frame(tmp_path / "a.npy").depth, DEPTH, atol=6e-4)


def test_millimetres_in_tums_layout_are_told(tmp_path):
    (tmp_path / "depth.txt").write_text("1.0 depth/1.0.png\n")
    (tmp_path / "intrinsics.json").write_text(json.dumps(FOUR))
    [note] = read_frame(image(tmp_path / "depth", name="1.0.png")).notes
    assert note.startswith("in the unit of the TUM benchmark, 1/5000 m, the median depth is 0.2")
    assert note.endswith("if depth is in millimetres, give run.depth_scale=0.001")
    assert not read_frame(tmp_path / "depth" / "1.0.png", depth_scale=0.001).notes


def exr_of(path, channels):
    exr = pytest.importorskip("OpenEXR")
    header = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage}
    with exr.File(header, {k: np.ascontiguousarray(v) for k, v in channels.items()}) as file:
        file.write(str(path))
    return path


GREY = np.random.default_rng(0).random(DEPTH.shape).astype(np.float32)


@pytest.mark.parametrize(
    "channels",
    [
        {"Z": DEPTH},
        {"R": GREY, "G": GREY, "B": GREY, "A": GREY, "Z": DEPTH},
        {"ViewLayer.Combined.R": GREY, "ViewLayer.Depth.Z": DEPTH, "ViewLayer.Normal.Z": GREY},
        {"depth": DEPTH, "confidence": GREY},
        {"distance": DEPTH},
        {"R": DEPTH, "G": DEPTH, "B": DEPTH},
        {"R": DEPTH, "G": 0 * DEPTH, "B": 0 * DEPTH},
    ],
    ids=lambda channels: "+".join(channels),
)
def test_depth_of_exr_is_chosen_by_its_name(tmp_path, channels):
    np.testing.assert_array_equal(read_exr(exr_of(tmp_path / "a.exr", channels)), DEPTH)


def test_colour_of_exr_is_no_depth(tmp_path):
    path = exr_of(tmp_path / "a.exr", {"R": DEPTH, "G": GREY, "B": GREY})
    with pytest.raises(InputError, match="none of them depth; store depth as channel Z"):
        read_exr(path)


def scan(count=4, size=(80, 60)):
    """Frames of a camera that moves, with colour that shows where a pixel looks."""
    for n in range(count):
        camera = camera_at((0.05 * n, -0.8, 0.6), size=size)
        u, v = np.meshgrid(np.linspace(0, 250, size[0]), np.linspace(0, 250, size[1]))
        colour = np.stack([u, v, 0 * u], axis=-1).astype(np.uint8)
        yield camera, frame_of(camera).depth, colour


def test_record3d_tells_camera_and_poses(tmp_path):
    """K is of colour in twice the pixels, column by column; poses are of ARKit."""
    poses, cameras = [], []
    (tmp_path / "rgb").mkdir()
    (tmp_path / "depth").mkdir()
    for n, ((camera, depth, _), (large, _, colour)) in enumerate(
        zip(scan(), scan(size=(160, 120)), strict=True)
    ):
        exr_of(tmp_path / "depth" / f"{n}.exr", {"R": depth, "G": 0 * depth, "B": 0 * depth})
        Image.fromarray(colour).save(tmp_path / "rgb" / f"{n}.png")
        arkit = camera.T_world_camera @ np.diag([1.0, -1, -1, 1])
        w, *xyz = quaternion_from_rotation(arkit[:3, :3])
        poses.append([*map(float, xyz), float(w), *arkit[:3, 3].tolist()])
        cameras.append((camera, large))
    content = {"K": cameras[0][1].matrix.T.ravel().tolist(), "w": 160, "h": 120, "poses": poses}
    (tmp_path / "metadata.json").write_text(json.dumps(content))
    frames = list(open_sequence(tmp_path))
    assert len(frames) == 4
    for frame, (camera, _) in zip(frames, cameras, strict=True):
        np.testing.assert_allclose(frame.camera.T_world_camera, camera.T_world_camera, atol=1e-6)
        np.testing.assert_allclose(frame.camera.matrix, K, atol=0.01)
        u = np.linspace(0, 250, 80)
        assert np.abs(frame.colour[30, 2:-2, 0] - u[2:-2]).max() < 4  # less than a pixel and a half
    np.testing.assert_allclose(read_frame(tmp_path / "depth/0.exr").camera.matrix, K, atol=0.01)
    for changes, message in (
        ({"w": 0}, "intrinsics are of 0 x 120 pixels"),
        ({"w": 120, "h": 160}, "are width and height swapped"),
        ({"poses": [[0.0] * 7, *poses[1:]]}, "has the length 0, not 1"),
    ):
        (tmp_path / "metadata.json").write_text(json.dumps({**content, **changes}))
        with pytest.raises(InputError, match=message):
            list(open_sequence(tmp_path))
    lost = {**content, "poses": [poses[0], [float("nan")] * 7, *poses[2:]]}
    (tmp_path / "metadata.json").write_text(json.dumps(lost))
    assert len(open_sequence(tmp_path)) == 3


@pytest.mark.parametrize("lost", [[2], [0, 5]])
@pytest.mark.parametrize("value", ["-inf", "nan", "inf"])
def test_scannets_layout_without_lost_poses(tmp_path, lost, value):
    source = tmp_path / "source"
    views = [
        frame_of_array(depth, camera, colour=colour, pose=camera.T_world_camera)
        for camera, depth, colour in scan(6)
    ]
    write_sequence(source, views)
    folder = tmp_path / "scene0000_00"
    (folder / "intrinsic").mkdir(parents=True)
    (folder / "pose").mkdir()
    (source / "depth").rename(folder / "depth")
    (source / "rgb").rename(folder / "color")
    np.savetxt(folder / "intrinsic" / "intrinsic_depth.txt", SCANNET)
    for n, view in enumerate(views):
        pose = view.camera.T_world_camera
        text = "\n".join([" ".join([value] * 4)] * 4) if n in lost else None
        name = folder / "pose" / f"{n:06d}.txt"
        name.write_text(text or "\n".join(" ".join(map(str, row)) for row in pose))
    sequence = open_sequence(folder)
    [note] = sequence.notes
    names = ", ".join(f"{n:06d}" for n in lost)
    assert note == f"frames without a pose, as tracking was lost, are left out: {names}"
    expected = [view for n, view in enumerate(views) if n not in lost]
    assert len(sequence) == len(expected)
    for frame, view in zip(sequence, expected, strict=True):
        np.testing.assert_allclose(frame.depth, view.depth, atol=6e-4)
        np.testing.assert_array_equal(frame.colour, view.colour)
        np.testing.assert_allclose(frame.camera.T_world_camera, view.camera.T_world_camera)


def poses_text(folder, poses):
    views = [frame_of_array(d, c, pose=c.T_world_camera) for c, d, _ in scan(len(poses))]
    write_sequence(folder, views)
    lines = [" ".join(f"{x:.17g}" for x in pose.ravel()) for pose in poses]
    (folder / "poses.txt").write_text("\n".join(lines))
    return folder


def test_rotations_that_are_nearly_orthonormal_are_mended_with_a_word(tmp_path):
    right = [camera.T_world_camera for camera, _, _ in scan()]
    rough = [pose.copy() for pose in right]
    for pose in rough:
        pose[:3, :3] += np.random.default_rng(0).normal(0, 2e-4, (3, 3))
    sequence = open_sequence(poses_text(tmp_path / "a", rough))
    [note] = sequence.notes
    assert "orthonormal to" in note
    assert note.endswith("only, and were made so")
    for pose, expected in zip(sequence.poses, right, strict=True):
        np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
        np.testing.assert_allclose(pose, expected, atol=1e-3)
    scaled = [pose @ np.diag([1.02, 1.02, 1.02, 1]) for pose in right]
    with pytest.raises(InputError, match="not a rigid motion"):
        open_sequence(poses_text(tmp_path / "b", scaled))


def test_poses_column_by_column_are_read(tmp_path):
    right = [camera.T_world_camera for camera, _, _ in scan()]
    sequence = open_sequence(poses_text(tmp_path / "a", [pose.T for pose in right]))
    np.testing.assert_allclose(sequence.poses, right, atol=1e-9)
