"""What librealsense itself recorded of a camera in software."""

import gc
import sys
import time

import numpy as np
import pytest

from scenefw.core.errors import ConfigError, InputError, MissingDependencyError
from scenefw.data.files.readers import find_images, read_frame
from scenefw_recordings.bags import Bag
from scenefw_recordings.capture import Capture
from scenefw_recordings.realsense import RealSense

rs = pytest.importorskip("pyrealsense2", reason="pip install 'scenefw[realsense]'")

WIDTH, HEIGHT, FOCAL, UNIT = 64, 48, 60.0, 0.00025
ASIDE = 0.05  # m between the lenses
FAR = 0.5  # m
COUNT = 6


def stream(kind, number, encoding, size):
    lens = rs.intrinsics()
    lens.width, lens.height, lens.fx, lens.fy = WIDTH, HEIGHT, FOCAL, FOCAL
    lens.ppx, lens.ppy, lens.model, lens.coeffs = 31.5, 23.5, rs.distortion.none, [0.0] * 5
    made = rs.video_stream()
    made.type, made.index, made.uid, made.fps = kind, 0, number, 30
    made.width, made.height, made.bpp, made.fmt = WIDTH, HEIGHT, size, encoding
    made.intrinsics = lens
    return made


def images(number):
    """A wall, nearer in its lower half with each image; colour says column and row."""
    depth = np.full((HEIGHT, WIDTH), round(FAR / UNIT), np.uint16)
    depth[HEIGHT // 2 :] -= 20 * number
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return depth, np.stack([3 * columns, 4 * rows, 0 * rows + 20 * number], -1).astype(np.uint8)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("camera") / "wall.db3"
    camera = rs.software_device()
    sensors = [camera.add_sensor("Depth"), camera.add_sensor("Color")]
    sensors[0].add_read_only_option(rs.option.depth_units, UNIT)
    kinds = [
        (rs.stream.depth, 0, rs.format.z16, 2),
        (rs.stream.color, 1, rs.format.bgr8, 3),
    ]
    profiles = [s.add_video_stream(stream(*k)) for s, k in zip(sensors, kinds, strict=True)]
    aside = rs.extrinsics()
    aside.rotation, aside.translation = [1, 0, 0, 0, 1, 0, 0, 0, 1], [ASIDE, 0, 0]
    profiles[0].register_extrinsics_to(profiles[1], aside)
    recorder = rs.recorder(str(path), camera)
    queue = rs.syncer()
    recorded = recorder.query_sensors()
    for sensor, profile in zip(recorded, profiles, strict=True):
        sensor.open(profile)
        sensor.start(queue)
    for number in range(COUNT):
        depth, colour = images(number)
        pictures = (depth, np.ascontiguousarray(colour[..., ::-1]))
        for sensor, profile, pixels in zip(sensors, profiles, pictures, strict=True):
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp = pixels, pixels.itemsize * (pixels.ndim > 2) * 3 or 2
            frame.stride = WIDTH * frame.bpp
            frame.timestamp, frame.frame_number = 1000.0 / 30 * number, number
            frame.domain = rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            if pixels is depth:
                frame.depth_units = UNIT
            sensor.on_video_frame(frame)
        time.sleep(0.05)
    for sensor in recorded:
        sensor.stop()
        sensor.close()
    del recorder, recorded, sensor
    gc.collect()  # closes the file
    return path


@pytest.fixture(scope="module")
def read(recording):
    """All its frames, whose end librealsense takes seconds to notice."""
    return list(RealSense(recording).frames())


def which(frame):
    """Number of the image that a frame is of, by its colour."""
    return int(frame.colour[HEIGHT // 2, WIDTH // 2, 2]) // 20


@pytest.mark.exhaustive
def test_colour_is_moved_to_the_pixels_of_depth(read):
    numbers = [which(frame) for frame in read]
    assert numbers == sorted(set(numbers))
    assert len(numbers) >= COUNT - 2  # librealsense may lose the first ones
    for number, frame in zip(numbers, read, strict=True):
        depth, colour = images(number)
        np.testing.assert_allclose(frame.depth, depth * UNIT, atol=1e-6)
        np.testing.assert_allclose(frame.matrix, [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]])
        rows, columns = np.mgrid[4 : HEIGHT - 4, 4 : WIDTH - 20]
        there = columns + FOCAL * ASIDE / (depth[rows, columns] * UNIT)
        assert np.abs(frame.colour[rows, columns, 0] / 3.0 - there).max() <= 1  # rounds to pixels
        assert np.abs(frame.colour[rows, columns, 1] / 4.0 - rows).max() <= 1
        assert (frame.colour[rows, columns, 2] == colour[0, 0, 2]).all()


def test_depth_is_moved_to_colour_or_there_is_no_colour(recording):
    frame = next(iter(RealSense(recording, align="colour").frames()))
    np.testing.assert_array_equal(frame.colour, images(which(frame))[1])
    shift = round(FOCAL * ASIDE / FAR)
    assert (frame.depth[:, : shift - 1] == 0).all()  # nothing that depth saw
    assert frame.depth[10, 30] == pytest.approx(FAR)
    assert next(iter(RealSense(recording, align="none").frames())).colour is None


def test_our_own_reader_finds_the_same_depth(recording, read):
    pytest.importorskip("rosbags")
    own = [frame.depth for frame in Bag(recording).frames()]
    assert len(own) == COUNT
    for frame in read:
        np.testing.assert_allclose(own[which(frame)], frame.depth, atol=1e-6)


def test_images_become_a_folder_that_is_read(recording, tmp_path, capsys):
    figures = Capture(recording, tmp_path, most=None, every=2).run()
    assert figures["images"] == figures["coloured"]
    assert figures["images"] in (2, 3)
    folder = tmp_path / "recording"
    assert str(folder) in capsys.readouterr().out
    paths = find_images(folder / "depth")
    assert len(paths) == figures["images"]
    frame = read_frame(paths[1])
    expected = images(which(frame))[0] * UNIT
    np.testing.assert_allclose(frame.depth, expected, atol=5.1e-4)  # written in mm
    assert Capture(recording, tmp_path / "two", most=2).run()["images"] == 2


def test_what_cannot_be_captured_is_one_line(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="no RealSense camera answers"):
        Capture(None, tmp_path).run()
    with pytest.raises(InputError, match="no file"):
        Capture(tmp_path / "missing.db3", tmp_path).run()
    (tmp_path / "bad.db3").write_text("no database")
    with pytest.raises(InputError, match="cannot play"):
        Capture(tmp_path / "bad.db3", tmp_path).run()
    assert not (tmp_path / "recording").exists()
    with pytest.raises(ConfigError, match=r"run\.align = left"):
        Capture(None, tmp_path, align="left")
    with pytest.raises(ConfigError, match=r"run\.most"):
        Capture(None, tmp_path, most=None)
    with pytest.raises(ConfigError, match=r"run\.every is 0"):
        Capture(None, tmp_path, every=0)
    with pytest.raises(ConfigError, match="warm_up = -1"):
        Capture(None, tmp_path, warm_up=-1)
    monkeypatch.setitem(sys.modules, "pyrealsense2", None)
    with pytest.raises(MissingDependencyError, match=r"scenefw\[realsense\]"):
        Capture(None, tmp_path).run()
