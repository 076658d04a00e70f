import numpy as np
import pytest
from tests.unit.tasks.recordings import CLASSES, GRID, frames, table
from tests.unit.tasks.test_label import hybrid, label

from scenefw.api.labeller import Labeller
from scenefw.core.errors import InputError
from scenefw.core.geometry import rigid
from scenefw.data.files.height_maps import load_map
from scenefw.data.files.sequences import transformed, write_sequence
from scenefw.labelling.by_height import ByHeight
from scenefw.labelling.map_based import MapBased
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.perception.observation.table_frame import TableFrame

TURN = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # z of the table is y of the recording


def by_height():
    return {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}


def added(labeller, recorded):
    for frame in recorded:
        pose = frame.camera.T_world_camera
        labeller.add(frame.depth, frame.camera, frame.colour, pose, name=frame.name)
    return labeller


def test_frames_one_by_one_give_what_the_command_line_gives(tmp_path):
    elsewhere = list(transformed(frames(), rigid(TURN, (1.0, 2.0, 3.0))))
    folder = write_sequence(tmp_path / "recording", elsewhere, CLASSES)
    label(folder, tmp_path / "out", by_height()).run()
    by_command = load_map(tmp_path / "out" / "map.npz", GRID)

    from scenefw.data.files.sequences import open_sequence

    labeller = added(Labeller(by_height(), TableFrame()), open_sequence(folder))
    assert len(labeller) == 6
    found = load_map(labeller.save(tmp_path / "map.npz"), GRID)
    np.testing.assert_array_equal(found.height_map.heights, by_command.height_map.heights)
    np.testing.assert_array_equal(found.height_map.labels, by_command.height_map.labels)
    for key, value in by_command.states["recording"].items():
        np.testing.assert_array_equal(found.states["recording"][key], value)
    assert labeller.save(tmp_path / "map.png").stat().st_size > 0


def test_a_map_grows_and_begins_anew():
    labeller = Labeller(by_height(), TableFrame())
    assert labeller.classes == CLASSES
    with pytest.raises(InputError, match="no frame yet"):
        labeller.height_map()
    first, *others = frames()
    few = added(labeller, [first]).height_map()
    many = added(labeller, others).height_map()
    assert few.seen.sum() < many.seen.sum()
    known = many.labels == 2
    assert np.mean(table().labels[known] > 0) > 0.9
    labeller.restart()
    again = added(labeller, [first]).height_map()
    np.testing.assert_array_equal(again.heights, few.heights)


def test_one_frame_needs_no_pose_and_a_second_does():
    labeller = Labeller(by_height(), TableFrame())
    first, second, *_ = frames()
    labeller.add(first.depth, first.camera, first.colour)
    heights = labeller.height_map().heights
    assert abs(np.nanmedian(heights)) < 0.005
    for pose in (None, second.camera.T_world_camera):
        with pytest.raises(InputError, match="frame 000001 needs poses"):
            labeller.add(second.depth, second.camera, second.colour, pose)
    assert len(labeller) == 1


def test_an_unusable_frame_leaves_the_map_as_it_is():
    labeller = Labeller(hybrid(), TableFrame())
    frame = next(frames())
    with pytest.raises(InputError, match="no measurements"):
        labeller.add(frame.depth * 0, frame.camera, frame.colour, np.eye(4))
    assert len(labeller) == 0


def test_unknown_formats_are_one_line(tmp_path):
    with pytest.raises(InputError, match=r"no format writes '\.tif'"):
        Labeller(by_height(), TableFrame()).save(tmp_path / "map.tif")
