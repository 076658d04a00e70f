import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from scenefw.core.errors import InputError, StorageError
from scenefw.core.geometry import look_at, quaternion_from_rotation, rigid
from scenefw.core.types import Camera, Frame
from scenefw.data.files.sequences import (
    RGBDFolder,
    TUMSequence,
    open_sequence,
    transformed,
    write_sequence,
)

CAMERA = Camera().resized(32, 24)


def frames(count=4, step=0.05):
    rng = np.random.default_rng(0)
    return [
        Frame(
            (0.3 + 0.001 * rng.integers(0, 100, (24, 32))).astype(np.float32),
            CAMERA.moved(look_at((i * step, 0.0, 0.4), (i * step + 0.1, 0.05, 0.0))),
            rng.integers(0, 255, (24, 32, 3), dtype=np.uint8),
            rng.integers(-1, 4, (24, 32), dtype=np.int32),
        )
        for i in range(count)
    ]


def write_tum(folder, given, *, lag=0.005, poses=True):
    """Depth at i / 30 s, colours and poses a little later; lines out of order."""
    lines = {"depth": [], "rgb": [], "groundtruth": ["# time tx ty tz qx qy qz qw"]}
    for i, frame in enumerate(given):
        time = i / 30
        for kind in ("depth", "rgb"):
            (folder / kind).mkdir(exist_ok=True)
            lines[kind].insert(0, f"{time + lag * (kind == 'rgb'):.6f} {kind}/{i}.png")
        depth = np.rint(frame.depth * 5000).astype(np.uint16)
        Image.fromarray(depth).save(folder / "depth" / f"{i}.png")
        Image.fromarray(frame.colour).save(folder / "rgb" / f"{i}.png")
        pose = frame.camera.T_world_camera
        w, x, y, z = quaternion_from_rotation(pose[:3, :3])
        numbers = (time - lag, *pose[:3, 3], x, y, z, w)
        lines["groundtruth"].append(" ".join(f"{value:.9f}" for value in numbers))
    for kind, text in lines.items():
        if poses or kind != "groundtruth":
            (folder / f"{kind}.txt").write_text("\n".join(text) + "\n")
    values = {key: getattr(CAMERA, key) for key in ("fx", "fy", "cx", "cy")}
    (folder / "intrinsics.json").write_text(json.dumps(values))
    return folder


def assert_same(read, given, *, labels=True):
    assert len(read) == len(given)
    for got, expected in zip(read, given, strict=True):
        np.testing.assert_allclose(got.depth, expected.depth, atol=5.1e-4)
        np.testing.assert_array_equal(got.colour, expected.colour)
        np.testing.assert_allclose(
            got.camera.T_world_camera, expected.camera.T_world_camera, atol=1e-6
        )
        assert got.camera.fx == pytest.approx(expected.camera.fx)
        if labels:
            np.testing.assert_array_equal(got.labels, expected.labels)


def test_a_folder_comes_back(tmp_path):
    write_sequence(tmp_path, frames(6))
    write_sequence(tmp_path, frames(), ["a", "b"])  # a shorter one over it
    read = open_sequence(tmp_path)
    assert isinstance(read, RGBDFolder)
    assert_same(read, frames())
    assert json.loads((tmp_path / "classes.json").read_text()) == ["a", "b"]


def test_nothing_of_an_earlier_sequence_stays_but_what_is_not_of_it(tmp_path):
    write_sequence(tmp_path, frames(6), ["a", "b"])
    (tmp_path / "notes.txt").write_text("mine")
    write_sequence(tmp_path, [replace(one, colour=None, labels=None) for one in frames()])
    assert all(one.colour is None and one.labels is None for one in RGBDFolder(tmp_path))
    left = sorted(path.name for path in tmp_path.glob("[!.]*"))
    assert left == ["depth", "intrinsics.json", "notes.txt", "poses.txt"]


@pytest.mark.parametrize("numbers", [7, 12])
def test_poses_have_several_formats(tmp_path, numbers):
    given = frames()
    write_sequence(tmp_path, given)
    lines = []
    for frame in given:
        pose = frame.camera.T_world_camera
        w, x, y, z = quaternion_from_rotation(pose[:3, :3])
        values = pose[:3].ravel() if numbers == 12 else (*pose[:3, 3], x, y, z, w)
        lines.append(", ".join(map(str, values)))
    (tmp_path / "poses.txt").write_text("\n".join(lines))
    assert_same(RGBDFolder(tmp_path), given)


def test_tum_format_is_associated_by_time(tmp_path):
    given = frames()
    read = open_sequence(write_tum(tmp_path, given))
    assert isinstance(read, TUMSequence)
    assert_same(read, given, labels=False)
    assert read[0].labels is None


@pytest.mark.parametrize("name", ["rgb.txt", "depth.txt", "groundtruth.txt"])
@pytest.mark.parametrize(
    ("time", "message"), [("nan", "has a time that is nan"), (None, "two lines of the time")]
)
def test_tum_times_that_choose_the_wrong_image_are_refused(tmp_path, name, time, message):
    write_tum(tmp_path, frames())
    lines = (tmp_path / name).read_text().splitlines()
    time, *rest = [time or lines[-1].split()[0], *lines[0].split()[1:]]
    (tmp_path / name).write_text("\n".join([" ".join([time, *rest]), *lines]))
    with pytest.raises(InputError, match=rf"{name} has .*{message.removeprefix('has ')}"):
        open_sequence(tmp_path)


def test_tum_images_without_a_pose_in_time_are_left_out(tmp_path):
    write_tum(tmp_path, frames())
    file = tmp_path / "groundtruth.txt"
    file.write_text("\n".join(file.read_text().splitlines()[:-1]))
    sequence = TUMSequence(tmp_path)
    assert len(sequence) == 3
    assert "1 of 4 depth images have no pose; the nearest to that of" in sequence.notes[0]
    assert len(TUMSequence(tmp_path, require_poses=False)) == 4
    with pytest.raises(InputError, match="no camera poses"):
        TUMSequence(tmp_path, largest_delay=0.001)


def test_frames_move_to_another_world():
    shift = rigid(np.diag([-1.0, -1.0, 1.0]), (1.0, 2.0, 3.0))
    moved = list(transformed(frames(2), shift))
    expected = shift @ frames(2)[1].camera.T_world_camera
    np.testing.assert_allclose(moved[1].camera.T_world_camera, expected)
    np.testing.assert_array_equal(moved[1].depth, frames(2)[1].depth)


def test_missing_poses_are_named_unless_not_needed(tmp_path):
    write_sequence(tmp_path, frames())
    (tmp_path / "poses.txt").unlink()
    with pytest.raises(InputError, match=r"no camera poses.*poses\.txt"):
        RGBDFolder(tmp_path)
    read = RGBDFolder(tmp_path, require_poses=False)
    np.testing.assert_array_equal(read[1].camera.T_world_camera, np.eye(4))
    tum = tmp_path / "tum"
    tum.mkdir()
    with pytest.raises(InputError, match=r"groundtruth\.txt"):
        TUMSequence(write_tum(tum, frames(), poses=False))


def test_a_jump_is_named(tmp_path):
    given = [*frames(3), *frames(4, step=0.5)[3:]]
    write_sequence(tmp_path, given)
    with pytest.raises(InputError, match=r"jump 1 time.*1\.40 m from frame 2 to 3"):
        RGBDFolder(tmp_path)
    assert len(RGBDFolder(tmp_path, largest_jump=None)) == 4
    write_sequence(tmp_path, given, ordered=False)
    assert len(RGBDFolder(tmp_path)) == 4
    tum = tmp_path / "tum"
    tum.mkdir()
    with pytest.raises(InputError, match="jump"):
        TUMSequence(write_tum(tum, given))


@pytest.mark.parametrize("ordered", [True, False])
def test_poses_in_millimetres_are_named(tmp_path, ordered):
    given = frames(3, step=100.0)
    with pytest.raises(InputError, match=r"poses of .* are up to 200 m .*: millimetres"):
        RGBDFolder(write_sequence(tmp_path / "a", given, ordered=ordered), largest_jump=None)
    (tum := tmp_path / "tum").mkdir()
    with pytest.raises(InputError, match=r"poses of .* are up to 200 m .*: millimetres"):
        TUMSequence(write_tum(tum, given), largest_jump=None)


def test_a_frame_of_another_size_is_named(tmp_path):
    write_sequence(tmp_path, frames())
    Image.fromarray(np.full((48, 64), 300, np.uint16)).save(tmp_path / "depth" / "000002.png")
    with pytest.raises(InputError, match=r"000002 is 64 x 48 pixels, the first one 32 x 24"):
        RGBDFolder(tmp_path)[2]
    Image.fromarray(np.zeros((48, 64, 3), np.uint8)).save(tmp_path / "rgb" / "000001.png")
    with pytest.raises(InputError, match="aligned"):
        RGBDFolder(tmp_path)[1]
    small = Frame(np.full((6, 8), 0.3, np.float32), Camera().resized(8, 6))
    with pytest.raises(InputError, match="same size"):
        write_sequence(tmp_path / "new", [*frames(1), small])


def test_millimetres_given_as_metres_are_named(tmp_path):
    write_sequence(tmp_path, frames())
    with pytest.raises(InputError, match="millimetres"):
        RGBDFolder(tmp_path, depth_scale=1.0)[0]


@pytest.mark.parametrize("kind", ["folder", "TUM"])
def test_floats_are_metres_and_whole_numbers_have_the_unit_of_the_format(tmp_path, kind):
    given = frames(2)
    if kind == "TUM":
        write_tum(tmp_path, given)
        listed = (tmp_path / "depth.txt").read_text().replace("depth/0.png", "images/0.npy")
        (tmp_path / "depth.txt").write_text(listed.replace("depth/1.png", "images/1.npy"))
        (tmp_path / "images").mkdir()
        files, unit = [tmp_path / "images" / f"{i}.npy" for i in range(2)], 5000
    else:
        write_sequence(tmp_path, given)
        files, unit = [tmp_path / "depth" / f"{i:06d}.npy" for i in range(2)], 1000
        for file in files:
            file.with_suffix(".png").unlink()
    np.save(files[0], given[0].depth)
    np.save(files[1], np.rint(given[1].depth * unit).astype(np.uint16))
    assert_same(open_sequence(tmp_path), given, labels=kind == "folder")
    with pytest.raises(InputError, match=r"^depth_scale = 0\.01 changes nothing for 0+\.npy"):
        open_sequence(tmp_path, depth_scale=0.01)[0]


def poses_text(tmp_path, text):
    write_sequence(tmp_path, frames(2))
    (tmp_path / "poses.txt").write_text(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 0 0 0 0 0 1\n", "1 poses, but .* 2 images"),
        ("1 2 3\n4 5 6\n", "3 numbers; expected"),
        ("0 0 0 0 0 0 0\n0 0 0 0 0 0 1\n", "no rotation"),
        ("a b c d e f g\n", "is not a pose: a b"),
        ("2 0 0 0 0 2 0 0 0 0 2 0\n" * 2, "not a rigid motion"),
    ],
)
def test_damaged_poses_are_named(tmp_path, text, message):
    poses_text(tmp_path, text)
    with pytest.raises(InputError, match=message):
        RGBDFolder(tmp_path)


def test_missing_files_are_named(tmp_path):
    with pytest.raises(InputError, match="no folder"):
        open_sequence(tmp_path / "none")
    with pytest.raises(InputError, match=r"no folder .*depth"):
        open_sequence(tmp_path)
    write_sequence(tmp_path, frames())
    (tmp_path / "rgb" / "000001.png").unlink()
    with pytest.raises(InputError, match=r"no image .*000001"):
        RGBDFolder(tmp_path)
    (tmp_path / "intrinsics.json").unlink()
    write_sequence(tmp_path, frames())
    (tmp_path / "intrinsics.json").unlink()
    with pytest.raises(InputError, match="no intrinsics"):
        RGBDFolder(tmp_path)
    with pytest.raises(InputError, match="no frame to write"):
        write_sequence(tmp_path, [])
    (tmp_path / "rgb.txt").write_text("x y\n")
    (tmp_path / "depth.txt").write_text("1.0\n")
    with pytest.raises(InputError, match="only a timestamp"):
        open_sequence(tmp_path)


def test_frames_without_labels_have_none(tmp_path):
    write_sequence(tmp_path, [replace(frame, labels=None) for frame in frames()])
    assert RGBDFolder(tmp_path)[0].labels is None


def unpadded(folder, given, names=None):
    """A sequence whose files are named 0, 1, ... without padding, or as given."""
    write_sequence(folder, given)
    for kind in ("depth", "rgb", "labels"):
        for i, name in enumerate(names or range(len(given))):
            (folder / kind / f"{i:06d}.png").rename(folder / kind / f"{name}.png")
    return (folder / "poses.txt").read_text().splitlines()


def test_frames_without_padding_keep_their_poses(tmp_path):
    given = frames(12, step=0.01)
    unpadded(tmp_path, given)
    assert_same(RGBDFolder(tmp_path), given)


@pytest.mark.parametrize(
    ("image", "line"),
    [
        ("{}", "{}"),
        ("{}", "depth/{}.png"),
        ("{}", "{:06d}"),
        ("{}.25", "{}.250000"),
        ("a{}", "a{}"),
    ],
)
def test_poses_with_names_may_come_in_any_order(tmp_path, image, line):
    given = frames(12, step=0.01)
    lines = unpadded(tmp_path, given, [image.format(i) for i in range(12)])
    named = [f"{line.format(i)} {pose}" for i, pose in enumerate(lines)]
    named.append(f"{line.format(77)} {lines[0]}")  # of an image that was left out
    (tmp_path / "poses.txt").write_text("\n".join(named[::-1]))
    assert_same(RGBDFolder(tmp_path), given)


def test_poses_may_lie_in_files_of_their_own(tmp_path):
    given = frames(12, step=0.01)
    lines = unpadded(tmp_path, given)
    (tmp_path / "poses").mkdir()
    for i, pose in enumerate(lines):
        rows = np.array(pose.split()).reshape(4, 4)
        (tmp_path / "poses" / f"{i}.txt").write_text("\n".join(map(" ".join, rows)))
    (tmp_path / "poses.txt").unlink()
    assert_same(RGBDFolder(tmp_path), given)
    (tmp_path / "poses" / "10.txt").unlink()
    with pytest.raises(InputError, match=r"no pose .*10\.txt beside .*10\.png; add it") as raised:
        RGBDFolder(tmp_path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: lines[:2] + lines[3:], r"has no pose for .*2\.png \(1 of 4 images"),
        (lambda lines: [f"frame{line}" for line in lines], r"\(4 of 4 images .*leave names out"),
        (lambda lines: [*lines, lines[1]], "two poses of image 1; keep one"),
        (lambda lines: [lines[0], *(line[2:] for line in lines[1:])], "line 2 .* in each line or"),
        (lambda lines: [f"{line} 1" for line in lines], "18 numbers; expected"),
    ],
)
def test_poses_of_other_images_are_named(tmp_path, change, message):
    lines = unpadded(tmp_path, frames())
    named = [f"{i} {pose}" for i, pose in enumerate(lines)]
    (tmp_path / "poses.txt").write_text("\n".join(change(named)))
    with pytest.raises(InputError, match=message) as raised:
        RGBDFolder(tmp_path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("kind", ["depth", "rgb"])
def test_tum_files_under_times_of_others_are_named(tmp_path, kind):
    write_tum(tmp_path, frames())
    file = tmp_path / f"{kind}.txt"
    lines = [line.split() for line in file.read_text().splitlines()]
    shifted = 1305031102.0  # names by another clock are no mistake
    for time, name in lines:
        (tmp_path / name).rename(tmp_path / kind / f"{float(time) + shifted:.6f}.png")
    times = [time for time, _ in lines]
    text = [f"{time} {kind}/{float(time) + shifted:.6f}.png" for time in times]
    file.write_text("\n".join(text))
    assert_same(TUMSequence(tmp_path), frames(), labels=False)
    swapped = [times[1], times[0], *times[2:]]
    names = [line.split()[1] for line in text]
    file.write_text("\n".join(map(" ".join, zip(swapped, names, strict=True))))
    with pytest.raises(InputError, match=f"lists {kind}/.* under time .*2 of 4 files"):
        TUMSequence(tmp_path)


@pytest.mark.parametrize("size", [100, 1200])
def test_a_full_disk_leaves_no_half_file(tmp_path, full_disk, size):
    with full_disk(size), pytest.raises(StorageError, match="File too large"):
        write_sequence(tmp_path, frames())
    assert not list(tmp_path.iterdir())
    assert not list(tmp_path.parent.glob(f".{tmp_path.name}.*"))


def test_hidden_files_are_no_images_and_suffixes_may_be_capitals(tmp_path):
    write_sequence(tmp_path, frames(3))
    for number, depth in enumerate(sorted((tmp_path / "depth").iterdir())):
        depth.with_name(f"._{depth.name}").write_bytes(b"of another program")
        if number == 1:
            depth.rename(depth.with_suffix(".PNG"))
    assert len(open_sequence(tmp_path)) == 3
    assert open_sequence(tmp_path)[1].depth.any()
