"""Bags written by rosbags, read back."""

import io
import json
import struct

import numpy as np
import pytest
from PIL import Image
from plugins.recordings.tests.bag_messages import (
    CAMERA,
    COLOUR,
    DEPTH,
    HEADER,
    K,
    compressed,
    recording,
    shades,
    written,
)

from scenefw.core.errors import ConfigError, InputError
from scenefw.data.files.readers import find_images, read_frame
from scenefw.data.files.sequences import RGBDFolder
from scenefw_recordings.bags import Bag
from scenefw_recordings.unpack_bag import UnpackBag


@pytest.mark.parametrize("old", [True, False])
def test_a_recording_becomes_a_folder_that_other_runs_read(tmp_path, old):
    bag = written(tmp_path / ("r.bag" if old else "r"), recording(padding=6), old)
    figures = UnpackBag(bag, tmp_path / "out", every=2).run()
    assert figures == {"images": 2.0, "coloured": 2.0}
    folder = tmp_path / "out" / "recording"
    images = find_images(folder / "depth")
    assert [path.name for path in images] == ["000000.png", "000001.png"]
    for path, more in zip(images, (0, 2), strict=True):
        frame = read_frame(path)
        assert np.allclose(frame.depth, (DEPTH + more) / 1000)
        assert np.array_equal(frame.colour, COLOUR)
        assert np.allclose(frame.camera.matrix, K)
    times = (folder / "times.txt").read_text().split()
    assert [float(time) for time in times] == [1.1, 3.0]
    assert json.loads((folder / "intrinsics.json").read_text())["K"] == K.tolist()


def test_metres_big_endian_bgr_and_compressed_images(tmp_path):
    metres = (DEPTH / 1000).astype(np.float32)
    metres[0, 0], metres[0, 1] = np.nan, -1.0
    [frame, *_] = Bag(written(tmp_path / "a", recording(metres, "32FC1", big=True))).frames()
    assert np.allclose(frame.depth[1:], metres[1:])
    assert (frame.depth[0, :2] == 0).all()
    png = io.BytesIO()
    Image.fromarray(DEPTH).save(png, "png")
    jpeg = io.BytesIO()
    Image.fromarray(COLOUR).save(jpeg, "png")
    packed = b"\0" * 12 + png.getvalue()
    messages = [
        ("/aligned/depth/info", 0, lambda s: s.info()),
        ("/color/compressed", 1, lambda s: s.compressed(jpeg.getvalue(), "rgb8; png")),
        ("/aligned/depth/compressedDepth", 2,
         lambda s: s.compressed(packed, "16UC1; compressedDepth png")),
    ]  # fmt: skip
    [frame] = Bag(written(tmp_path / "b", messages)).frames()
    assert np.allclose(frame.depth, DEPTH / 1000)
    assert np.array_equal(frame.colour, COLOUR)
    messages = recording()
    messages[1] = (messages[1][0], 1, lambda s: s.image(COLOUR[..., ::-1], "bgr8"))
    [frame, *_] = Bag(written(tmp_path / "c", messages)).frames(max_frames=1)
    assert np.array_equal(frame.colour, COLOUR)


def test_realsense_recordings_say_their_unit_and_keep_colour_apart(tmp_path):
    sensor = "/device_0/sensor_0"
    messages = [
        (f"{sensor}/option/Depth_Units/value", 0, lambda s: s.number(0.0001)),
        (f"{sensor}/Depth_0/info/camera_info", 0, lambda s: s.info()),
        ("/device_0/sensor_1/Color_0/info/camera_info", 0, lambda s: s.info()),
        ("/device_0/sensor_1/Color_0/image/data", 1, lambda s: s.image(COLOUR, "rgb8")),
        (f"{sensor}/Depth_0/image/data", 2, lambda s: s.image(DEPTH, "mono16")),
    ]
    [frame] = Bag(written(tmp_path / "r.bag", messages, old=True)).frames()
    assert np.allclose(frame.depth, DEPTH * 1e-4, rtol=1e-5)
    assert frame.colour is None  # it isn't aligned


@pytest.mark.parametrize(
    ("left", "options", "said"),
    [
        ([1], {}, "no topic with images is named depth"),
        ([2, 3, 4], {}, "no topic beside"),
        (
            [0, 2],
            {"depth": "/nothing"},
            "there is no topic /nothing of Image or Comp.*; the bag has",
        ),
        (
            [0, 1],
            {"depth": "/camera/color/image_raw", "info": f"{CAMERA}/camera_info"},
            "encoded as rgb8; expected one of 16UC1",
        ),
        ([0, 2], {"depth": f"{CAMERA}/camera_info"}, "there is no topic .*camera_info of Image"),
        ([0, 2], {"info": f"{CAMERA}/image_raw"}, "there is no topic .*image_raw of CameraInfo"),
    ],
)
def test_what_a_bag_lacks_is_one_line(tmp_path, left, options, said):
    bag = written(tmp_path / "r", [recording()[k] for k in left])
    with pytest.raises(InputError, match=said) as caught:
        list(Bag(bag, **options).frames())
    assert "\n" not in str(caught.value)


def test_damaged_missing_and_senseless_input(tmp_path):
    (tmp_path / "no.bag").write_bytes(b"#ROSBAG V2.0\n broken")
    with pytest.raises(InputError, match=r"cannot read .*no\.bag"):
        UnpackBag(tmp_path / "no.bag", tmp_path / "out").run()
    assert not (tmp_path / "out" / "recording").exists()
    with pytest.raises(InputError, match="no file or folder"):
        UnpackBag(tmp_path / "none.bag", tmp_path / "out").run()
    with pytest.raises(ConfigError, match="give input=PATH"):
        UnpackBag(None, tmp_path)
    with pytest.raises(ConfigError, match=r"run.every is 0"):
        UnpackBag("r", tmp_path, every=0)
    short = recording()[:3]
    short[2] = (short[2][0], 1, lambda s: s.image(DEPTH[:, :10], "16UC1"))

    def cut(store):
        message = store.image(DEPTH, "16UC1")
        message.data = message.data[:100]
        return message

    short[2] = (short[2][0], 1, cut)
    with pytest.raises(InputError, match="too little for 40 x 30"):
        UnpackBag(written(tmp_path / "r", short), tmp_path / "out").run()
    assert not (tmp_path / "out" / "recording").exists()


@pytest.mark.parametrize("old", [True, False])
def test_readers_of_images_say_what_reads_a_bag(tmp_path, old):
    bag = written(tmp_path / ("r.bag" if old else "r"), recording(), old)
    with pytest.raises(InputError, match="run=unpack_bag input="):
        [read_frame(path) for path in find_images(bag)]


def test_images_without_a_measurement_are_left_out(tmp_path, capsys):
    messages = [*recording()[:1], *recording()[2:5]]
    messages[1] = (messages[1][0], 1, lambda s: s.image(DEPTH * 0, "16UC1"))
    figures = UnpackBag(written(tmp_path / "r", messages), tmp_path / "out").run()
    assert figures == {"images": 2.0, "coloured": 0.0}
    assert "1 of 3 depth images are left out: nothing is measured" in capsys.readouterr().err
    assert len(list(RGBDFolder(tmp_path / "out" / "recording", require_poses=False))) == 2


SENSOR = "/device_0/sensor_0"


def of_unit(unit, depth=DEPTH, encoding="mono16"):
    return [
        (f"{SENSOR}/option/Depth_Units/value", 0, lambda s: s.number(unit)),
        (f"{SENSOR}/Depth_0/info/camera_info", 0, lambda s: s.info()),
        (f"{SENSOR}/Depth_0/image/data", 2, lambda s: s.image(depth, encoding)),
    ]


NO_PIXELS = [
    ("/depth_registered/camera_info", 0, lambda s: s.info()),
    ("/depth_registered/image_raw", 1, lambda s: s.image(DEPTH[:, :0], "16UC1")),
]


@pytest.mark.parametrize(
    ("messages", "options", "said"),
    [
        (of_unit(np.nan), {}, r"says nan metres per unit of depth; give run\.depth_scale"),
        (of_unit(-1), {}, "says -1 metres per unit"),
        (of_unit(0), {}, "says 0 metres per unit"),
        (of_unit(1), {}, r"millimetres given as metres\? give run\.depth_scale=0\.001"),
        (of_unit(1, DEPTH.astype(np.float32), "32FC1"), {}, "multiply it by 0.001"),
        (of_unit(1, DEPTH.astype(np.float32), "32FC1"), {"depth_scale": 0.001}, "leave it out"),
        (of_unit(1, DEPTH * 0), {}, "none of 1 depth images has a measurement"),
        (NO_PIXELS, {}, r"has shape \(30, 0\)"),
        (
            compressed("16UC1; compressedDepth rvl", HEADER + struct.pack("<II", 0, 0)),
            {},
            r"has shape \(0, 0\)",
        ),
        (
            [*shades([], [1]), *shades([], [2], DEPTH[:20])[1:]],
            {},
            "depth image 2 has 40 x 20 pixels, the first one 40 x 30; run.most=1",
        ),
    ],
)
def test_depth_that_no_run_could_read_is_not_written(tmp_path, messages, options, said):
    bag = written(tmp_path / "r", messages)
    with pytest.raises(InputError, match=said) as caught:
        UnpackBag(bag, tmp_path / "out", **options).run()
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out" / "recording").exists()


def test_a_given_unit_goes_before_that_of_the_bag(tmp_path):
    [frame] = Bag(written(tmp_path / "r", of_unit(np.nan)), depth_scale=0.0005).frames()
    np.testing.assert_allclose(frame.depth, DEPTH * 0.0005, rtol=1e-6)
    with pytest.raises(ConfigError, match="depth_scale = 0: expected"):
        UnpackBag("r", tmp_path, depth_scale=0)
