import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from tests.unit.tasks.recordings import CLASSES, GRID, frames, table

from scenefw.core.errors import ConfigError, IncompleteError, InputError
from scenefw.core.geometry import inverse, rigid
from scenefw.core.height_maps import HeightGrid
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.data.files.readers import read_frame
from scenefw.data.files.sequences import transformed, write_sequence
from scenefw.labelling.by_height import ByHeight
from scenefw.labelling.hybrid import Hybrid
from scenefw.labelling.map_based import MapBased
from scenefw.labelling.sources import NetworkMapLabels, TrueLabels
from scenefw.labelling.view_based import ViewBased
from scenefw.learning.checkpoint import load_checkpoint
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.mapping.semantic_fusion import SemanticFusion
from scenefw.perception.observation.points import world_points
from scenefw.tasks.label import Label
from scenefw_labelling_studies.image_space_fusion import ImageSpaceFusion

WORDS = ["run=label", "debug=smoke", "paths.output=out"]


def hybrid():
    maps = ByHeight(CLASSES, "keyboard")
    return {
        "hybrid": Hybrid(HeightFusion(GRID), SemanticFusion(), TrueLabels(CLASSES, 0.0, 1.0), maps)
    }


def label(folder, out, strategies=None, **options):
    options = {"picture_every": 2, "save_every": 3} | options
    return Label(folder, strategies or hybrid(), GRID, out, **options)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory):
    return write_sequence(tmp_path_factory.mktemp("recording"), frames(), CLASSES)


def test_a_sequence_becomes_a_map_that_is_seen_to_grow(sequence, tmp_path):
    figures = label(sequence, tmp_path).run()
    assert figures["frames"] == 6
    saved = load_map(tmp_path / "map.npz", GRID)
    known = saved.height_map.labels >= 0
    assert known.mean() == pytest.approx(figures["coverage"], abs=1e-3)
    assert np.mean(saved.height_map.labels[known] == table().labels[known]) > 0.97
    grown = sorted(path.name for path in (tmp_path / "growth").iterdir())
    assert grown == ["000002.png", "000004.png", "000006.png"]
    with Image.open(tmp_path / "growth.gif") as film:
        assert film.n_frames >= 3
    assert (tmp_path / "map.png").is_file()


@pytest.mark.parametrize("level", [0.004, -1.0])
def test_a_table_that_is_labelled_as_things_is_told(sequence, tmp_path, capsys, level):
    """Below a level of -1 m nothing is surface."""
    maps = ByHeight(CLASSES, "keyboard", level=level)
    strategies = {"map_based": MapBased(HeightFusion(GRID), maps)}
    label(sequence, tmp_path / "map", strategies, picture_every=None).run()
    label(sequence / "depth" / "000000.png", tmp_path / "image", strategies).run()
    said = "labelled as things, mostly keyboard"
    assert capsys.readouterr().err.count(said) == (2 if level < 0 else 0)


@pytest.mark.parametrize("height", [0.0, 0.1, -0.1])
def test_a_second_table_is_told(tmp_path, capsys, height):
    views = []
    for frame in frames():
        points = world_points(frame)
        eye = frame.camera.T_world_camera[2, 3]
        factor = np.where(points[..., 1] > 0, (eye - height) / eye, 1)
        views.append(replace(frame, depth=(frame.depth * factor).astype(np.float32)))
    label(write_sequence(tmp_path / "two", views, CLASSES), tmp_path / "map").run()
    said = capsys.readouterr().err
    assert ("another wide surface lies 10 cm" in said) == bool(height)


TURN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # z of the table is y of the recording


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory):
    """The same recording, its poses in a world that is not the table's."""
    folder = tmp_path_factory.mktemp("elsewhere")
    return write_sequence(folder, transformed(frames(), rigid(TURN, (1.0, 2.0, 3.0))), CLASSES)


def test_a_saved_map_resumes_as_if_never_interrupted(elsewhere, tmp_path):
    folder, plain = elsewhere, {"picture_every": None}
    label(folder, tmp_path / "whole", **plain).run()
    label(folder, tmp_path / "first", frames=4, **plain).run()
    resume = tmp_path / "first" / "map.npz"
    label(folder, tmp_path / "rest", resume=resume, start=4, **plain).run()
    whole, rest = (load_map(tmp_path / name / "map.npz") for name in ("whole", "rest"))
    np.testing.assert_array_equal(whole.height_map.heights, rest.height_map.heights)
    np.testing.assert_array_equal(whole.height_map.labels, rest.height_map.labels)
    for key, value in whole.states["recording"].items():
        np.testing.assert_array_equal(value, rest.states["recording"][key])


def test_a_map_that_lost_its_world_is_not_resumed(sequence, elsewhere, tmp_path):
    """Maps of earlier versions don't say how their recording's world lies."""
    for folder in (sequence, elsewhere):
        label(folder, tmp_path / "first", frames=4, picture_every=None).run()
        saved = load_map(tmp_path / "first" / "map.npz")
        states = {name: state for name, state in saved.states.items() if name != "recording"}
        old = save_map(tmp_path / "old.npz", saved.height_map, states)
        resumed = label(folder, tmp_path / "rest", resume=old, start=4)
        if folder == sequence:  # its world is the table's
            assert resumed.run()["frames"] == 2
            recording = load_map(tmp_path / "rest" / "map.npz").states["recording"]
            np.testing.assert_array_equal(recording["T_map_world"], np.eye(4))
        else:
            with pytest.raises(InputError, match="fuse the whole recording again"):
                resumed.run()


def test_labels_are_fused_in_image_space_as_well(sequence, tmp_path):
    def views(**refresh):
        parts = HeightFusion(GRID), ImageSpaceFusion(), TrueLabels(CLASSES, 0.0, 1.0)
        return {"view_based": ViewBased(*parts, **refresh)}

    assert views()["view_based"].refresh == 10  # it reads the map
    with pytest.raises(ConfigError, match="reads the height map"):
        views(refresh=0)
    label(sequence, tmp_path, views(refresh=1)).run()
    found = load_map(tmp_path / "map.npz", GRID).height_map
    known = found.labels >= 0
    assert known.mean() > 0.3
    assert np.mean(found.labels[known] == table().labels[known]) > 0.97


def test_frames_without_a_measurement_are_left_out(sequence, tmp_path, capsys):
    (folder := tmp_path / "in").mkdir()
    for path in sequence.iterdir():
        copy = shutil.copytree if path.is_dir() else shutil.copy
        copy(path, folder / path.name)
    for number in (0, 3):
        Image.fromarray(np.zeros((60, 80), np.uint16)).save(folder / "depth" / f"{number:06d}.png")
    figures = label(folder, tmp_path / "out").run()
    assert (figures["frames"], figures["left_out"]) == (4, 2)
    assert "without a measurement: 0, 3" in capsys.readouterr().err
    names = load_map(tmp_path / "out" / "map.npz").states["recording"]["names"].tolist()
    assert names == ["000001", "000002", "000004", "000005"]
    with pytest.raises(InputError, match="has a measurement"):
        label(folder, tmp_path / "none", frames=1).run()
    resume = tmp_path / "out" / "map.npz"
    with pytest.raises(InputError, match="has a measurement"):
        label(folder, tmp_path / "none", frames=1, resume=resume).run()


def test_an_interrupted_map_is_saved(sequence, tmp_path):
    strategies = hybrid()
    source = strategies["hybrid"].source
    original = source.label

    def stop_at_fourth(frame):
        if frame.name.endswith("3"):
            raise KeyboardInterrupt
        return original(frame)

    source.label = stop_at_fourth
    with pytest.raises(KeyboardInterrupt):
        label(sequence, tmp_path, strategies).run()
    assert load_map(tmp_path / "map.npz").height_map.seen.any()


def test_poses_of_another_world_are_brought_to_the_table(elsewhere, tmp_path, capsys):
    maps = {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}
    label(elsewhere, tmp_path / "out", maps).run()
    assert "the table was found" in capsys.readouterr().err
    heights = load_map(tmp_path / "out" / "map.npz").height_map.heights
    assert np.nanmedian(heights) == pytest.approx(0, abs=0.002)
    assert np.nanpercentile(heights, 99) == pytest.approx(0.03, abs=0.003)


class Perfect:
    """Odometry that knows the motion."""

    def track(self, shown):
        first, truths = None, list(frames())
        for frame in shown:
            pose = truths[int(frame.name)].camera.T_world_camera
            first = inverse(pose) if first is None else first
            yield replace(frame, camera=frame.camera.moved(first @ pose))


def test_a_sequence_without_poses_is_tracked(sequence, tmp_path):
    (bare := tmp_path / "in").mkdir()
    for name in ("depth", "rgb", "intrinsics.json"):
        (bare / name).symlink_to(sequence / name)
    with pytest.raises(InputError, match="no camera poses"):
        label(bare, tmp_path / "out").run()
    with pytest.raises(ConfigError, match="odometry"):
        label(bare, tmp_path / "out", estimate_poses=True).run()
    maps = {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}
    tracking = {"estimate_poses": True, "odometry": Perfect(), "picture_every": None}
    label(bare, tmp_path / "out", maps, **tracking).run()
    whole = load_map(tmp_path / "out" / "map.npz")
    assert np.nanmedian(whole.height_map.heights) == pytest.approx(0, abs=0.002)
    label(bare, tmp_path / "first", maps, frames=3, **tracking).run()
    resume = tmp_path / "first" / "map.npz"
    for start in (0, 2, 5):
        resumed = label(bare, tmp_path / "rest", maps, resume=resume, start=start, **tracking)
        if start == 2:  # frame 2 twice, but in its place
            assert resumed.run()["frames"] == 4
        else:
            with pytest.raises(InputError, match=r"give run\.start=NUMBER"):
                resumed.run()
    label(bare, tmp_path / "rest", maps, resume=resume, start=3, **tracking).run()
    rest = load_map(tmp_path / "rest" / "map.npz")
    np.testing.assert_allclose(rest.height_map.heights, whole.height_map.heights, atol=1e-4)
    assert rest.states["recording"]["names"].tolist() == [f"{i:06d}" for i in range(6)]


def test_single_images_become_maps_of_their_own(sequence, tmp_path, capsys):
    (folder := tmp_path / "in").mkdir()
    (folder / "intrinsics.json").write_text((sequence / "intrinsics.json").read_text())
    for i, frame in enumerate(frames(2)):
        np.save(folder / f"view{i}.npy", frame.depth)
        Image.fromarray(frame.colour).save(folder / f"view{i}.rgb.png")
    np.save(folder / "view9.npy", np.zeros((60, 80), np.float32))
    maps = {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}
    with pytest.raises(IncompleteError, match=r"^1 of 3 images is unusable") as end:
        label(folder, tmp_path / "out", maps).run()
    assert (end.value.figures["images"], end.value.figures["failed"]) == (3, 1)
    assert "skipped" in capsys.readouterr().err
    found = load_map(tmp_path / "out" / "view1" / "map.npz").height_map
    assert np.nanpercentile(found.heights, 99) == pytest.approx(0.03, abs=0.003)
    assert (tmp_path / "out" / "view0" / "map.png").is_file()


def test_settings_are_checked(sequence, tmp_path):
    with pytest.raises(ConfigError, match="input=FOLDER"):
        label(None, tmp_path)
    with pytest.raises(ConfigError, match="one strategy"):
        Label(sequence, {}, GRID, tmp_path)
    with pytest.raises(ConfigError, match="depth_scale"):
        label(sequence, tmp_path, depth_scale=0.0)


@pytest.mark.parametrize(
    ("setting", "value"),
    [
        ("largest_jump", -1),
        ("start", -1),
        ("frames", 0),
        ("picture_every", -1),
        ("save_every", 0),
        ("save_every", -2),
    ],
)
def test_numbers_of_frames_that_are_none_are_named(sequence, tmp_path, setting, value):
    with pytest.raises(
        ConfigError, match=rf"^{setting} = {value}: expected ([01] or more|more than 0)"
    ):
        label(sequence, tmp_path, **{setting: value})


def test_results_are_not_mixed_with_the_recording(sequence):
    with pytest.raises(ConfigError, match="is the folder of the input"):
        label(sequence, sequence)


def complaint(scenefw, *words):
    """The one line that a wrong command is answered with."""
    done = scenefw(*words)
    assert done.returncode == 2, done.stderr[-3000:]
    lines = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert len(lines) == 1
    assert "Traceback" not in done.stderr
    return lines[0]


def test_command_line(scenefw, sequence, tmp_path):
    done = scenefw(*WORDS, f"input={sequence}")
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.splitlines()[-1] == str(tmp_path / "out")
    assert (tmp_path / "out" / "map.npz").is_file()
    save_map(tmp_path / "other.npz", table_of(65))
    line = complaint(scenefw, *WORDS, f"input={sequence}", "run.resume=other.npz")
    assert "other.npz lies on" in line


def test_a_recording_that_jumps_or_changes_size(scenefw, tmp_path):
    folder = write_sequence(tmp_path / "jumps", frames(3, step=0.5))
    assert "0.5" in complaint(scenefw, *WORDS, f"input={folder}")
    folder = write_sequence(tmp_path / "sizes", frames(3))
    Image.fromarray(np.full((30, 40), 600, np.uint16)).save(folder / "depth" / "000001.png")
    assert "40 x 30" in complaint(scenefw, *WORDS, f"input={folder}")


def test_an_error_in_the_middle_says_where_the_map_so_far_is(sequence, tmp_path):
    class Failing:
        def begin(self):
            running = hybrid()["hybrid"].begin()
            add, names = running.add, []

            def failing(frame):
                names.append(frame.name)
                if len(names) == 3:
                    raise InputError("the third frame is damaged")
                add(frame)

            running.add = failing
            return running

    with pytest.raises(
        InputError, match=r"third .*\(the map of the frames before it is .*map\.npz"
    ):
        label(sequence, tmp_path, {"failing": Failing()}).run()
    assert load_map(tmp_path / "map.npz").height_map.seen.any()


def test_a_map_of_other_classes(scenefw, sequence, tmp_path):
    other = table()
    object.__setattr__(other, "classes", ("surface", "coin", "pen", "book"))
    save_map(tmp_path / "coins.npz", other)
    line = complaint(scenefw, *WORDS, f"input={sequence}", "run.resume=coins.npz")
    assert "surface, coin, pen, book" in line


def table_of(vertices):
    from scenefw.core.height_maps import HeightGrid, HeightMap

    blank = np.zeros((vertices, vertices), np.float32)
    colour = np.zeros((vertices, vertices, 3), np.uint8)
    return HeightMap(HeightGrid(vertices), blank, colour, blank, blank)


def test_a_real_image_becomes_a_map_whose_table_is_flat(real_data, tmp_path):
    grid = HeightGrid(257)
    network = NetworkMapLabels(load_checkpoint(task="segmentation", shipped="label_maps"))
    strategies = {"map_based": MapBased(HeightFusion(grid), network)}
    image = real_data / "real" / "realsense_table" / "uois_1.npz"
    figures = Label(image, strategies, grid, tmp_path).run()
    assert figures["failed"] == 0
    found = load_map(tmp_path / "uois_1" / "map.npz", grid).height_map
    surface = found.seen & (found.labels == 0)
    assert 0.3 < found.seen.mean() < 0.9  # the camera sees neither all of it nor behind objects
    flat = found.seen & (np.abs(np.nan_to_num(found.heights)) < 0.006)
    assert flat.sum() > 0.5 * found.seen.sum()
    assert surface[flat].mean() > 0.75
    assert np.median(np.abs(found.heights[surface])) < 0.005
    raised = found.seen & (np.nan_to_num(found.heights) > 0.03)
    assert (found.labels[raised] > 0).mean() > 0.7


def test_a_real_image_resumes_in_the_same_place(real_data, tmp_path):
    """Its camera is the world of its poses, which is not the table's."""
    image = read_frame(real_data / "real" / "realsense_table" / "uois_1.npz")
    shown = write_sequence(tmp_path / "in", [image] * 3)
    grid, heights = HeightGrid(129), {}
    maps = {"map_based": MapBased(HeightFusion(grid), ByHeight(CLASSES, "keyboard"))}
    for name, options in {
        "whole": {},
        "first": {"frames": 1},
        "rest": {"resume": tmp_path / "first" / "map.npz", "start": 1},
    }.items():
        Label(shown, maps, grid, tmp_path / name, picture_every=None, **options).run()
        heights[name] = load_map(tmp_path / name / "map.npz", grid).height_map.heights
    np.testing.assert_array_equal(heights["rest"], heights["whole"])


def test_a_start_behind_the_end_says_where_the_end_is(sequence, tmp_path):
    with pytest.raises(InputError, match=r"^run\.start = 6: expected less than 6"):
        label(sequence, tmp_path, start=6).run()


def test_settings_of_sequences_are_refused_for_images(sequence, tmp_path):
    with pytest.raises(ConfigError, match=r"run\.start.*are for sequences"):
        label(sequence / "depth", tmp_path, start=2).run()
