from dataclasses import replace

import numpy as np
import pytest
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError
from scenefw.noise.frames import disturb
from scenefw.noise.gaussian import Gaussian
from scenefw.noise.pose import Jitter
from scenefw_tabletops.data.fused_maps import FusedMaps, in_turns


class LastView:
    """A fusion that tells how many frames it has seen."""

    def __init__(self, offset=0.0):
        self.grid, self.offset = Rectangles().grid, offset

    def begin(self, previous=None):
        source, offset, names = Rectangles(), self.offset, []

        class Running:
            def add(self, frame):
                names.append(frame.name)

            def height_map(self):
                truth = source.truth(int(names[0].split("/")[1]))
                truth.heights[:] += offset + len(set(names))
                return truth

        return Running()


def test_a_map_is_fused_once(tmp_path):
    source = Rectangles()
    maps = FusedMaps(source, LastView(), frames=4, folder=tmp_path)
    first = maps(1)
    assert source.fetched == 3 + 4
    again = FusedMaps(source, LastView(), frames=4, folder=tmp_path)(1)
    assert source.fetched == 3 + 4 + 3  # the truth and two views name the file
    np.testing.assert_array_equal(first.heights, again.heights)
    np.testing.assert_array_equal(first.heights, Rectangles().truth(1).heights + np.float32(4))
    np.testing.assert_array_equal(first.colour, again.colour)


def test_other_settings_are_other_files(tmp_path):
    for scene, frames, fusion in ((0, 4, 0.0), (1, 4, 0.0), (0, 3, 0.0), (0, 4, 1.0)):
        FusedMaps(Rectangles(), LastView(fusion), frames, tmp_path)(scene)
    FusedMaps(Rectangles(seed=1), LastView(), 4, tmp_path)(0)
    assert len(list(tmp_path.glob("*.npz"))) == 5


def test_without_a_folder_nothing_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    FusedMaps(Rectangles(), LastView(), 2, None)(0)
    assert not list(tmp_path.iterdir())
    with pytest.raises(ConfigError, match="frames = 0"):
        FusedMaps(Rectangles(), LastView(), 0)


class KeptFrames(LastView):
    """A fusion that keeps the frames it is given."""

    def __init__(self):
        super().__init__()
        self.frames = []

    def begin(self, previous=None):
        running = super().begin(previous)
        add, frames = running.add, self.frames

        def kept(frame):
            frames.append(frame)
            add(frame)

        running.add = kept
        return running


def test_scenes_are_fused_under_each_noise_in_turns(tmp_path):
    noise = {
        "exact": {},
        "depth": {"gaussian": Gaussian(0.001)},
        "tracked": {"pose": Jitter(0.002)},
    }
    fusion = KeptFrames()
    maps = FusedMaps(Rectangles(scenes=5), fusion, 2, None, noise, seed=3)
    for scene in range(5):
        maps(scene)
    true = [frame for scene in range(5) for frame in Rectangles(scenes=5).frames(scene, 2)]
    found = {"depth": [], "tracked": []}
    for seen, frame in zip(fusion.frames, true, strict=True):
        found["depth"].append(not np.array_equal(seen.depth, frame.depth))
        found["tracked"].append(
            not np.array_equal(seen.camera.T_world_camera, frame.camera.T_world_camera)
        )
    assert found["depth"] == [False] * 2 + [True] * 2 + [False] * 4 + [True] * 2
    assert found["tracked"] == [False] * 4 + [True] * 2 + [False] * 4
    np.testing.assert_array_equal(
        fusion.frames[3].depth, disturb(true[3], noise["depth"], 3, 1, 1).depth
    )


def test_other_noise_is_another_file(tmp_path):
    def make(noise, seed=0):
        FusedMaps(Rectangles(), LastView(), 2, tmp_path, noise, seed)(1)
        return len(list(tmp_path.glob("*.npz")))

    one = {"a": {"gaussian": Gaussian(0.001)}}
    assert make(None) == 1
    assert make({"a": {}}) == 1
    assert make(one) == 2
    assert make({"b": {}, **one}) == 2  # scene 1 has the same noise
    assert make(one, seed=1) == 3
    assert make({"a": {"gaussian": Gaussian(0.002)}}) == 4


class Repainted(Rectangles):
    """Views from `first` on in other colours, with other labels, or through another lens."""

    def __init__(self, first=0, **changed):
        super().__init__()
        self.first, self.changed = first, changed

    def frames(self, scene, count, start=0):
        for view, frame in enumerate(super().frames(scene, count, start), start):
            changed = self.changed if view >= self.first else {}
            yield replace(frame, **{name: make(frame) for name, make in changed.items()})


class Lifted(Rectangles):
    """An object that neither the first nor the last view shows is higher."""

    def truth(self, scene):
        truth = super().truth(scene)
        truth.heights[3, 4] += 0.01
        return truth


@pytest.mark.parametrize("first", [0, 2])
def test_all_that_the_first_and_the_last_view_show_names_the_file(tmp_path, first):
    for changed in (
        {},
        {"colour": lambda frame: 255 - frame.colour},
        {"labels": lambda frame: 2 - frame.labels},
        {"camera": lambda frame: replace(frame.camera, fx=70.0)},
    ):
        FusedMaps(Repainted(first, **changed), LastView(), 3, tmp_path)(0)
    assert len(list(tmp_path.glob("*.npz"))) == 4


def test_another_scene_around_the_same_views_is_another_file(tmp_path):
    for source in (Rectangles(), Lifted(), Rectangles()):
        FusedMaps(source, LastView(), 2, tmp_path)(0)
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_scenes_take_noise_in_turns():
    rough, still = {"gaussian": Gaussian(0.01)}, {}
    noises = {"rough": rough, "still": still, "moved": {"pose": Jitter(0.001)}}
    assert [in_turns(noises, scene) is rough for scene in range(5)] == [True, False, False] + [
        True,
        False,
    ]
    assert in_turns(noises, 4) is still
    assert in_turns({}, 3) == {}
