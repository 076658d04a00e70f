from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from tests.unit.perception.observation.test_colour_alignment import painted
from tests.unit.perception.obstacles import OBSTACLES
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.floors import Floor
from scenefw.core.types import Camera, GridSpec
from scenefw.data.files.readers import read_frames
from scenefw.perception.observation import doctor
from scenefw.perception.observation.colour_alignment import ColourShift
from scenefw.perception.observation.depth_reading import better_reading, blended_ratio
from scenefw.perception.observation.doctor import Doctor
from scenefw.perception.observation.floor import FloorFinder
from scenefw.perception.observation.obstacles import ObstacleRegion
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.workspace import Workspace, WorkspaceFinder


@pytest.fixture(scope="module")
def frame():
    return frame_of(camera_at())


def with_camera(frame, **changes):
    camera = frame.camera
    settings = {k: getattr(camera, k) for k in ("width", "height", "fx", "fy", "cx", "cy")}
    return replace(frame, camera=Camera(**(settings | changes)))


def test_a_good_view_has_no_warning(frame):
    assert Doctor().examine_frame(frame) == []
    floor = FloorFinder().find(frame)
    workspace = WorkspaceFinder(OBSTACLES).find(frame, floor, GridSpec())
    assert Doctor().examine_workspace(floor, workspace) == []


def test_millimetres_as_metres(frame):
    with pytest.raises(
        InputError, match=r"millimetres given as metres\? .* in metres; multiply it by 0.001"
    ):
        Doctor().examine_frame(replace(frame, depth=frame.depth * 1000))


def test_focal_length_of_another_size(frame):
    with pytest.raises(InputError, match="give a view of"):
        Doctor().examine_frame(with_camera(frame, fx=5000.0, fy=5000.0))


@pytest.mark.parametrize(
    ("changes", "words"),
    [({"fx": 500.0}, "differ"), ({"cx": 10.0}, "far from the middle")],
)
def test_odd_intrinsics_are_warned_of(frame, changes, words):
    (warning,) = Doctor().examine_frame(with_camera(frame, **changes))
    assert words in warning


def test_few_measurements_are_warned_of(frame):
    depth = frame.depth.copy()
    depth[60:] = 0
    (warning,) = Doctor().examine_frame(replace(frame, depth=depth))
    assert "25%" in warning


def test_colour_beside_the_depth_is_warned_of():
    depth, colour = painted((320, 240), (0, 0))
    good = replace(frame_of(camera_at()), depth=depth, colour=colour)
    verdicts = {check.name: check for check in Doctor().check_frame(good)}
    assert verdicts["colour"].verdict == "good"
    (warning,) = Doctor().examine_frame(replace(good, colour=np.roll(colour, (-12, 8), (0, 1))))
    assert warning.startswith("edges of colour seem to lie ")
    assert " pixels to the right and " in warning
    assert " pixels above, seen from where depth jumps; align colour to depth" in warning
    assert (
        Doctor(min_alignment=0.0).examine_frame(replace(good, colour=np.roll(colour, 12, 0))) == []
    )


def test_a_shift_along_one_axis_alone_is_told_alone(frame, monkeypatch):
    monkeypatch.setattr(doctor, "colour_shift", lambda *_: ColourShift(0, -16, 0.2))
    painted_frame = replace(frame, colour=np.zeros((*frame.depth.shape, 3), np.uint8))
    (warning,) = Doctor().examine_frame(painted_frame)
    assert "lie 16 pixels to the left, seen from where depth jumps" in warning


def test_many_pixels_are_warned_of_with_a_remedy_that_helps(frame):
    camera = frame.camera
    many = np.kron(frame.depth, np.ones((20, 20), np.float32))
    names = ("width", "height", "fx", "fy", "cx", "cy")
    large = Camera(**{name: getattr(camera, name) * 20 for name in names})
    (warning,) = Doctor().examine_frame(replace(frame, depth=many, camera=large))
    megapixels = many.size / 1e6
    assert f"{large.width} x {large.height} pixels take long and much memory" in warning
    every = int(warning.partition("::")[2].partition(",")[0])
    assert megapixels / every**2 <= 4 < megapixels / (every - 1) ** 2
    assert warning.endswith(f"fx, fy, cx, cy divided by {every}")


@pytest.mark.parametrize(
    ("distance", "size", "left_out", "deviation", "words"),
    [
        (3.0, 0.3, (), 0.002, "3.0"),
        (0.2, 0.3, (), 0.002, "0.2"),
        (0.9, 0.02, (), 0.002, "2.0 cm"),
        (0.9, 0.3, ((0.6, 0.1),), 0.002, "1 object group"),
        (0.9, 0.3, (), 0.015, "15 mm"),
    ],
)
def test_workspace_warnings(frame, distance, size, left_out, deviation, words):
    pose = np.eye(4)
    pose[2, 3] = size / 2 + distance  # from the middle of the objects
    placed = replace(frame, camera=frame.camera.moved(pose))
    everywhere = np.ones(frame.depth.shape, dtype=bool)
    workspace = Workspace(
        placed,
        everywhere,
        np.full(3, size),
        np.reshape(left_out, (-1, 2)),
        (),
        ~everywhere,
        world_points(placed),
    )
    floor = Floor(np.array([0.0, 0.0, -1.0]), distance, 0.5, deviation)
    (warning,) = Doctor().examine_workspace(floor, workspace)
    assert words in warning


@pytest.mark.parametrize(("degrees", "verdict"), [(90, "good"), (30, "good"), (5, "odd")])
def test_a_camera_that_looks_along_the_table_is_odd(degrees, verdict):
    angle = np.radians(degrees)
    floor = Floor(np.array([0.0, -np.cos(angle), -np.sin(angle)]), 0.5, 0.5, 0.002)
    _, tilt = Doctor().check_floor(floor)
    assert (tilt.verdict, bool(tilt.fix)) == (verdict, verdict == "odd")
    assert f"looking {degrees} degrees down" in tilt.found


def test_every_check_that_is_not_good_says_what_helps(frame):
    odd = with_camera(frame, fx=500.0, cx=10.0)
    few = np.where(np.arange(320) % 4 == 0, frame.depth, 0)
    checks = Doctor().check_frame(replace(odd, depth=few))
    assert [check.name for check in checks] == ["unit", "intrinsics", "centre", "measured"]
    assert [check.verdict for check in checks] == ["good", "odd", "odd", "odd"]
    assert all(bool(check.fix) == (check.verdict != "good") for check in checks)


@pytest.mark.parametrize(
    ("made", "setting"),
    [
        (lambda: Doctor(min_distance=-1), "min_distance"),
        (lambda: Doctor(min_distance=2, max_distance=1), "max_distance"),
        (lambda: Doctor(min_measured_ratio=2), "min_measured_ratio"),
        (lambda: Doctor(min_tilt=-3), "min_tilt"),
        (lambda: FloorFinder(inlier_distance=-0.01), "inlier_distance"),
        (lambda: FloorFinder(iterations=0), "iterations"),
        (lambda: FloorFinder(min_inlier_ratio=1.5), "min_inlier_ratio"),
        (lambda: WorkspaceFinder(OBSTACLES, floor_margin=-1), "floor_margin"),
        (lambda: WorkspaceFinder(OBSTACLES, min_pixels=0), "min_pixels"),
    ],
)
def test_settings_out_of_range_are_named(made, setting):
    with pytest.raises(ConfigError, match=setting):
        made()


def test_a_centre_of_the_turned_image_is_named():
    camera = camera_at()
    frame = frame_of(camera)
    swapped = replace(camera, cx=camera.cy, cy=camera.cx)
    (line,) = Doctor().examine_frame(replace(frame, camera=swapped.moved(np.eye(4))))
    assert "far from the middle" in line
    assert "swap cx and cy" in line


def test_a_centre_a_little_off_in_a_nearly_square_image_is_not_swapped():
    camera = camera_at(eye=(0.0, -0.8, 0.6), size=(640, 600))
    frame = frame_of(camera)
    aside = replace(camera, cx=300.0, cy=310.0)
    assert not Doctor().examine_frame(replace(frame, camera=aside.moved(np.eye(4))))


@pytest.mark.parametrize(("share", "verdict"), [(0.5, "good"), (0.12, "odd")])
def test_a_floor_of_which_little_is_seen_is_odd(share, verdict):
    """As a known floor has it, if the camera has moved since."""
    even, _ = Doctor().check_floor(Floor(np.array([0.0, 0.0, -1.0]), 0.8, share, 0.002))
    assert (even.verdict, "moved?" in even.fix) == (verdict, verdict == "odd")
    assert f"{share:.0%} of the points" in even.found


@pytest.mark.parametrize(
    ("rows", "columns", "words"),
    [
        (np.s_[:80], np.s_[:], "50% wall at the top"),
        (np.s_[80:160], np.s_[240:], "50% wall at the right"),
        (np.s_[:4], np.s_[:4], None),  # hardly anything
    ],
)
def test_what_is_no_object_is_told_with_its_place(frame, rows, columns, words):
    floor = FloorFinder().find(frame)
    workspace = WorkspaceFinder(OBSTACLES).find(frame, floor, GridSpec())
    wall = np.zeros(frame.depth.shape, dtype=bool)
    wall[rows, columns] = True
    objects = workspace.objects if words is None else np.roll(wall, 100, axis=0)
    regions = (ObstacleRegion("wall", wall),)
    warnings = Doctor().examine_workspace(
        floor, replace(workspace, objects=objects, obstacles=regions)
    )
    assert len(warnings) == (words is not None)
    assert all(words in line and "run.masks" in line for line in warnings)


@pytest.mark.parametrize("size", [(160, 120), (320, 240)])
def test_distances_along_rays_are_told_from_depth(size):
    frame = frame_of(camera_at(size=size), noise=0.001)
    assert Doctor().examine_floor(frame, FloorFinder())[1] == []
    camera = frame.camera
    rows, columns = np.indices(frame.depth.shape)
    rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy], axis=-1)
    distances = frame.depth * np.sqrt(1 + (rays**2).sum(axis=-1))
    rays_frame = replace(frame, depth=distances.astype(np.float32))
    (warning,) = Doctor().examine_floor(rays_frame, FloorFinder())[1]
    assert "distances from the camera's centre" in warning


@pytest.mark.parametrize(
    "numbers",
    [
        lambda depth: 3.0 / 2.7 * (1 - 0.3 / depth),  # from 0.3 to 3 m
        lambda depth: 10 / 9.9 * (1 - 0.1 / depth),
        lambda depth: 1 / depth,
        lambda depth: np.rint(16 * 45 / depth) / 1000,  # disparities in sixteenths of a pixel
    ],
)
def test_inverse_depths_are_told_from_depth(numbers):
    frame = frame_of(camera_at(), noise=0.0005)
    (warning,) = Doctor().examine_floor(
        replace(frame, depth=numbers(frame.depth).astype(np.float32)), FloorFinder()
    )[1]
    assert "inverse depths: disparities, or values of a depth buffer" in warning


@pytest.mark.parametrize("height", [0.45, 0.7, 0.95])
@pytest.mark.parametrize("noise", [0.0, 0.001])
def test_a_floor_from_straight_above_is_no_other_reading(height, noise):
    frame = frame_of(camera_at(eye=(0.0, 0.001, height)), noise=noise)
    assert Doctor().examine_floor(frame, FloorFinder())[1] == []


def test_real_depth_is_depth_and_nothing_else(real_data):
    readings = []
    for frame in read_frames(real_data / "real" / "realsense_table"):
        assert Doctor().examine_floor(frame, FloorFinder())[1] == []
        assert blended_ratio(frame.depth) < 0.05
        inverse = np.divide(1, frame.depth, where=frame.depth > 0, out=np.zeros_like(frame.depth))
        inverse_frame = replace(frame, depth=inverse)
        floor = FloorFinder().find(inverse_frame)
        readings.append(better_reading(inverse_frame, floor, FloorFinder()))
    assert sum("inverse" in reading for reading in readings) >= len(readings) - 1


@pytest.mark.parametrize("scale", [0.5, 1.5])
def test_interpolated_depth_is_warned_of(scale):
    frame = frame_of(camera_at())
    depth = frame.depth.copy()
    depth[40:60, 50:90] = 0
    camera = frame.camera.resized(
        round(scale * frame.camera.width), round(scale * frame.camera.height)
    )
    size = (camera.width, camera.height)
    for method, expected in ((Image.Resampling.NEAREST, False), (Image.Resampling.BILINEAR, True)):
        resized = np.asarray(Image.fromarray(depth).resize(size, method))
        warnings = Doctor().examine_frame(replace(frame, depth=resized, camera=camera))
        assert any("nearest neighbours" in warning for warning in warnings) == expected


@pytest.mark.parametrize("factor", [0.75, 1.5, 2.0])
def test_intrinsics_of_another_size_are_warned_of(frame, factor):
    (warning,) = Doctor().examine_frame(
        with_camera(frame, cx=frame.camera.cx / factor, cy=frame.camera.cy / factor)
    )
    assert "of another image size" in warning


def test_a_second_table_lower_down_is_told(frame):
    depth, height = frame.depth.copy(), camera_at().T_world_camera[2, 3]
    left = slice(frame.camera.width // 4)
    depth[:, left] *= (height + 0.2) / height
    floor = FloorFinder().find(frame)
    workspace = WorkspaceFinder(OBSTACLES).find(replace(frame, depth=depth), floor, GridSpec())
    warnings = Doctor().examine_workspace(floor, workspace)
    assert any("another surface lies" in warning for warning in warnings)
