import numpy as np
import pytest
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError
from scenefw.data.fused_maps import FusedMaps


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
    assert source.fetched == 1 + 4
    again = FusedMaps(source, LastView(), frames=4, folder=tmp_path)(1)
    assert source.fetched == 1 + 4 + 1  # the first view names the file
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
