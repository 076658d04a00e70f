"""Bags written by rosbags, read back."""

import contextlib
import io
import json
import struct
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from PIL import Image

from scenefw.core.errors import ConfigError, InputError
from scenefw.data.files.lens import lens_of, undistorted
from scenefw.data.files.readers import find_images, read_frame
from scenefw.data.files.sequences import RGBDFolder
from scenefw_recordings.bags import Bag
from scenefw_recordings.rvl import decode_rvl
from scenefw_recordings.unpack_bag import UnpackBag

rosbag2 = pytest.importorskip("rosbags.rosbag2")
from rosbags.rosbag1 import Writer as OldWriter  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

K = np.array([[60.0, 0, 19.5], [0, 61.0, 14.5], [0, 0, 1]])
DEPTH = np.random.default_rng(0).integers(400, 2000, (30, 40)).astype(np.uint16)
COLOUR = np.random.default_rng(1).integers(0, 256, (30, 40, 3)).astype(np.uint8)
CAMERA = "/camera/aligned_depth_to_color"


class Store:
    """Messages of one version of ROS."""

    def __init__(self, old):
        self.old = old
        self.types = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)

    def of(self, name, **values):
        return self.types.types[name](**values)

    def header(self, time=0):
        stamp = self.of("builtin_interfaces/msg/Time", sec=time, nanosec=0)
        extra = {"seq": 0} if self.old else {}
        return self.of("std_msgs/msg/Header", stamp=stamp, frame_id="camera", **extra)

    def image(self, pixels, encoding, padding=0, big=False):
        rows = pixels.reshape(len(pixels), -1)
        rows = rows.astype(rows.dtype.newbyteorder(">" if big else "<"))
        data = np.ascontiguousarray(rows).view(np.uint8).reshape(len(pixels), -1)
        data = np.pad(data, ((0, 0), (0, padding)), constant_values=7)
        return self.of(
            "sensor_msgs/msg/Image", header=self.header(), height=len(pixels),
            width=pixels.shape[1], encoding=encoding, is_bigendian=int(big), step=data.shape[1],
            data=data.ravel(),
        )  # fmt: skip

    def compressed(self, data, form):
        return self.of(
            "sensor_msgs/msg/CompressedImage", header=self.header(), format=form,
            data=np.frombuffer(data, np.uint8),
        )  # fmt: skip

    def info(
        self, model="plumb_bob", coefficients=(0,) * 5, projection=(0,) * 12, matrix=K,
        size=(40, 30), region=(0, 0, 0, 0), binning=0,
    ):  # fmt: skip
        names = ("x_offset", "y_offset", "width", "height")
        roi = self.of(
            "sensor_msgs/msg/RegionOfInterest", **dict(zip(names, region, strict=True)),
            do_rectify=False,
        )  # fmt: skip
        names = "DKRP" if self.old else "dkrp"
        values = (
            np.array(coefficients, float),
            matrix.ravel(),
            np.eye(3).ravel(),
            np.array(projection, float),
        )
        return self.of(
            "sensor_msgs/msg/CameraInfo", header=self.header(), height=size[1],
            width=size[0], distortion_model=model, binning_x=binning, binning_y=binning, roi=roi,
            **dict(zip(names, values, strict=True)),
        )  # fmt: skip

    def number(self, value):
        return self.of("std_msgs/msg/Float32", data=value)


def written(path, messages, old=False):
    """A bag of (topic, seconds, function of the store)."""
    store = Store(old)
    writer = OldWriter(path) if old else rosbag2.Writer(path, version=9)
    with writer:
        known = {}
        for topic, seconds, make in messages:
            message = make(store)
            kind = message.__msgtype__
            if topic not in known:
                known[topic] = writer.add_connection(topic, kind, typestore=store.types)
            serialise = store.types.serialize_ros1 if old else store.types.serialize_cdr
            writer.write(known[topic], int(seconds * 1e9), serialise(message, kind))
    return path


def recording(depth=DEPTH, encoding="16UC1", **options):
    return [
        (f"{CAMERA}/camera_info", 0.5, lambda s: s.info()),
        ("/camera/color/image_raw", 1, lambda s: s.image(COLOUR, "rgb8", padding=5)),
        (f"{CAMERA}/image_raw", 1.1, lambda s: s.image(depth, encoding, **options)),
        (f"{CAMERA}/image_raw", 2, lambda s: s.image(depth + 1, encoding, **options)),
        (f"{CAMERA}/image_raw", 3, lambda s: s.image(depth + 2, encoding, **options)),
        ("/camera/color/image_raw", 2.1, lambda s: s.image(COLOUR, "rgb8")),
        ("/camera/color/image_raw", 3.1, lambda s: s.image(COLOUR, "rgb8")),
    ]


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


def compressed(form, data, colour=False):
    return [
        ("/depth_registered/camera_info", 0, lambda s: s.info()),
        *([("/rgb/image_raw", 1, lambda s: s.image(COLOUR, "rgb8"))] if colour else []),
        ("/depth_registered/image_raw/compressedDepth", 2, lambda s: s.compressed(data, form)),
    ]


def png_of(pixels):
    data = io.BytesIO()
    Image.fromarray(pixels).save(data, "png")
    return data.getvalue()


def rvl_of(pixels):
    """The published encoder, number by number."""
    nibbles, values, place, previous = [], pixels.ravel().tolist(), 0, 0

    def put(number):
        while True:
            nibble, number = number & 7, number >> 3
            nibbles.append(nibble | (8 if number else 0))
            if not number:
                return

    while place < len(values):
        zeros = next((n for n, v in enumerate(values[place:]) if v), len(values) - place)
        place += zeros
        others = next((n for n, v in enumerate(values[place:]) if not v), len(values) - place)
        put(zeros)
        put(others)
        for value in values[place : place + others]:
            delta, previous = value - previous, value
            put((delta << 1) ^ (delta >> 31))
        place += others
    nibbles += [0] * (-len(nibbles) % 8)
    words = [
        int("".join(f"{n:x}" for n in nibbles[k : k + 8]), 16) for k in range(0, len(nibbles), 8)
    ]
    return struct.pack("<II", pixels.shape[1], pixels.shape[0]) + struct.pack(
        f"<{len(words)}I", *words
    )


HOLES = np.where(np.random.default_rng(2).random(DEPTH.shape) < 0.3, 0, DEPTH).astype(np.uint16)
A, B = 4000.0, 2.0  # of inverted depth
INVERSE = np.rint(A / (np.where(HOLES, HOLES, 1) / 1000) + B).astype(np.uint16) * (HOLES > 0)
HEADER = struct.pack("<iff", 0, A, B)


@pytest.mark.parametrize(
    ("form", "data", "tolerance"),
    [
        ("16UC1; compressedDepth png", HEADER + png_of(HOLES), 1e-6),
        ("16UC1; compressedDepth", HEADER + png_of(HOLES), 1e-6),  # before 2020
        ("16UC1; png compressed ", png_of(HOLES), 1e-6),  # of image_transport's plain plugin
        ("png", png_of(HOLES), 1e-6),
        ("16UC1; compressedDepth rvl", HEADER + rvl_of(HOLES), 1e-6),
        ("32FC1; compressedDepth png", HEADER + png_of(INVERSE), 2e-3),
        ("32FC1; compressedDepth", HEADER + png_of(INVERSE), 2e-3),
        ("32FC1; compressedDepth rvl", HEADER + rvl_of(INVERSE), 2e-3),
    ],
)
def test_depth_is_compressed_in_many_ways(tmp_path, form, data, tolerance):
    [frame] = Bag(written(tmp_path / "r", compressed(form, data, colour=True))).frames()
    assert np.allclose(frame.depth, HOLES / 1000, atol=tolerance)
    assert ((frame.depth > 0) == (HOLES > 0)).all()
    assert np.array_equal(frame.colour, COLOUR)


@pytest.mark.parametrize(
    ("form", "data", "said"),
    [
        ("16UC1; compressedDepth rvl", HEADER + rvl_of(HOLES)[:40], "is damaged"),
        ("16UC1; jpeg compressed", b"\xff\xd8\xff" + bytes(40), "expected depth as PNG or RVL"),
        ("16UC1; compressedDepth png", HEADER + png_of(HOLES)[:60], "is damaged"),
        ("rgb8; png compressed", png_of(COLOUR), "pictures of colour"),
        ("8UC1; png compressed", png_of(COLOUR[..., 0]), "8 bits per pixel"),
    ],
)
def test_what_is_no_compressed_depth_is_one_line(tmp_path, form, data, said):
    bag = written(tmp_path / "r", compressed(form, data))
    with pytest.raises(InputError, match=said) as caught:
        list(Bag(bag).frames())
    assert "\n" not in str(caught.value)


@given(values=arrays(np.uint16, st.integers(1, 60), elements=st.sampled_from([0, 0, 1, 9, 65535])))
def test_rvl_is_the_published_codec(values):
    data = rvl_of(values[None])
    assert np.array_equal(decode_rvl(data[8:], values.size), values)


@given(data=st.binary(max_size=80), pixels=st.integers(0, 200))
def test_damaged_rvl_is_told(data, pixels):
    with contextlib.suppress(ValueError):
        assert decode_rvl(data, pixels).shape == (pixels,)


def test_images_are_undistorted_by_their_camera_info(tmp_path):
    rational = [0.9, 0.02, 0.001, -0.001, 0.01, 0.2, 0.03, 0.0]
    messages = compressed("16UC1; png compressed", png_of(DEPTH), colour=True)
    messages[0] = (messages[0][0], 0, lambda s: s.info("rational_polynomial", rational))
    [frame] = Bag(written(tmp_path / "r", messages)).frames()
    _, note = frame.notes
    assert "undistorted by the coefficients D of /depth_registered/camera_info" in note
    lens = lens_of("rational_polynomial", rational, "r")
    depth, colour = undistorted(lens, K, [(DEPTH / 1000).astype(np.float32), COLOUR], "r")
    assert np.array_equal(frame.depth, depth)
    assert np.array_equal(frame.colour, colour)
    assert not np.allclose(frame.depth, DEPTH / 1000)


def test_rectified_images_have_the_intrinsics_of_their_projection(tmp_path):
    projection = np.hstack([K * [[0.9, 1, 1], [1, 0.9, 1], [1, 1, 1]], np.zeros((3, 1))])
    info = {"coefficients": [0.3, 0, 0, 0, 0], "projection": projection.ravel()}
    messages = [
        ("/depth/camera_info", 0, lambda s: s.info(**info)),
        ("/depth/image_rect_raw", 1, lambda s: s.image(DEPTH, "16UC1")),
    ]  # fmt: skip
    [frame] = Bag(written(tmp_path / "r", messages)).frames()
    assert np.allclose(frame.matrix, projection[:, :3])
    assert np.allclose(frame.depth, DEPTH / 1000)


@pytest.mark.parametrize(
    ("colour", "said"),
    [
        (np.zeros((60, 80, 3), np.uint8), "it has 80 x 60 pixels, depth 40 x 30"),
        (COLOUR, None),
    ],
)
def test_colour_of_another_size_is_left_out_with_a_line(tmp_path, capsys, colour, said):
    messages = [m for m in recording() if m[0] != "/camera/color/image_raw"]
    messages += [("/camera/color/image_raw", t, lambda s: s.image(colour, "rgb8")) for t in (1, 2)]
    figures = UnpackBag(written(tmp_path / "r", messages), tmp_path / "out").run()
    assert figures == {"images": 3.0, "coloured": 0.0 if said else 3.0}
    assert (said or "") in capsys.readouterr().err


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


FULL = K * [[2], [2], [1]]  # of images of 80 x 60 pixels


@pytest.mark.parametrize(
    ("info", "matrix"),
    [
        ({"matrix": FULL, "size": (80, 60), "binning": 2}, K),
        (
            {"matrix": FULL, "size": (80, 60), "region": (20, 15, 40, 30)},
            FULL - [[0, 0, 20], [0, 0, 15], [0, 0, 0]],
        ),
        (
            {
                "matrix": FULL * [[2], [2], [1]],
                "size": (160, 120),
                "region": (40, 30, 80, 60),
                "binning": 2,
            },
            FULL - [[0, 0, 20], [0, 0, 15], [0, 0, 0]],
        ),
        ({"size": (0, 0)}, K),
    ],
)
def test_intrinsics_are_those_of_the_region_and_of_binned_pixels(tmp_path, info, matrix):
    messages = recording()
    messages[0] = (messages[0][0], 0, lambda s: s.info(**info))
    [frame] = Bag(written(tmp_path / "r", messages)).frames(max_frames=1)
    np.testing.assert_allclose(frame.matrix, matrix)


@pytest.mark.parametrize(
    ("info", "said"),
    [
        (
            {"matrix": FULL, "size": (80, 60)},
            "has 40 x 30 pixels, but its intrinsics are of 80 x 60",
        ),
        ({"size": (80, 60), "binning": 4}, "its intrinsics are of 20 x 15"),
        ({"matrix": K * np.nan}, "fx = nan"),
        ({"matrix": K * 0}, "fx = 0"),
        ({"matrix": -K}, "fx = -60"),
    ],
)
def test_intrinsics_that_cannot_be_are_one_line(tmp_path, info, said):
    messages = recording()
    messages[0] = (messages[0][0], 0, lambda s: s.info(**info))
    with pytest.raises(
        InputError, match=rf"{said}.*{CAMERA}/camera_info: run\.info=TOPIC"
    ) as caught:
        list(Bag(written(tmp_path / "r", messages)).frames())
    assert "\n" not in str(caught.value)


def shades(times, depth_times, depth=DEPTH):
    """A recording whose n-th colour image is of the value n."""
    return [
        (f"{CAMERA}/camera_info", 0, lambda s: s.info()),
        *(
            ("/camera/color/image_raw", t, lambda s, n=n: s.image(COLOUR * 0 + n, "rgb8"))
            for n, t in enumerate(times)
        ),
        *((f"{CAMERA}/image_raw", t, lambda s: s.image(depth, "16UC1")) for t in depth_times),
    ]  # fmt: skip


@pytest.mark.parametrize("old", [True, False])
def test_colour_is_the_nearest_in_time_or_none(tmp_path, old):
    messages = shades([2, 3, 4, 4.5], [0.5, 1.5, 2.2, 2.6, 2.8, 3.9, 4.6, 9])
    bag = Bag(written(tmp_path / ("r.bag" if old else "r"), messages, old))
    frames = list(bag.frames())
    numbers = [None if f.colour is None else int(f.colour[0, 0, 0]) for f in frames]
    assert numbers == [None, 0, 0, 1, 1, 2, 3, None]
    assert frames[0].notes[1] == (
        "no colour for 2 of 8 depth images: /camera/color/image_raw has none within 1 s of them"
    )
    every_third = [int(f.colour[0, 0, 0]) for f in islice(bag.frames(3), 1, None)]
    assert every_third == [1, 3]


def test_what_is_written_is_a_sequence_with_colour_for_all_images(tmp_path, capsys):
    path = written(tmp_path / "r", shades([2, 3, 4], [0.5, 2.2, 3.1, 9]))
    figures = UnpackBag(path, tmp_path / "out").run()
    assert figures == {"images": 2.0, "coloured": 2.0}
    assert "2 of 4 depth images are left out" in capsys.readouterr().err
    folder = tmp_path / "out" / "recording"
    sequence = RGBDFolder(folder, require_poses=False)
    assert [frame.colour[0, 0, 0] for frame in sequence] == [0, 1]
    assert [float(t) for t in (folder / "times.txt").read_text().split()] == [2.2, 3.1]
    assert UnpackBag(path, tmp_path / "out", colour="none").run()["images"] == 4
    assert all(frame.colour is None for frame in RGBDFolder(folder, require_poses=False))


@pytest.mark.parametrize("encoding", ["mono8", "bayer_rggb8"])
def test_colour_that_cannot_be_read_is_left_out_with_a_line(tmp_path, capsys, encoding):
    messages = recording()[:3]
    messages[1] = (messages[1][0], 1, lambda s: s.image(COLOUR[..., 0], encoding))
    figures = UnpackBag(written(tmp_path / "r", messages), tmp_path / "out").run()
    assert figures == {"images": 1.0, "coloured": 0.0}
    assert f"colour is left out: /camera/color/image_raw is encoded as {encoding}" in (
        capsys.readouterr().err
    )
    assert len(RGBDFolder(tmp_path / "out" / "recording", require_poses=False)) == 1


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
