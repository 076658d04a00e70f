"""Fused maps go into one file, and a training starts from that file alone."""

import pytest
import torch
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError
from scenefw.data.label_views import StoredViews, ViewSamples
from scenefw.data.map_crops import MapCrops, StoredMaps
from scenefw.data.packed_maps import PackedMaps
from scenefw.data.segmentation import SegmentationData
from scenefw.tasks.pack_maps import PackMaps


def data():
    train, validation = (MapCrops(StoredMaps(Rectangles(n, seed=n)), 3, (24, 16)) for n in (3, 1))
    return SegmentationData(train, validation)


@pytest.mark.parametrize("workers", [1, 2])
def test_maps_are_packed(tmp_path, workers, capsys):
    path = tmp_path / "maps.npz"
    figures = PackMaps(data(), path, workers=workers).run()
    assert figures["maps/train"] == 3
    assert figures["maps/validation"] == 1
    assert figures["mb"] == pytest.approx(path.stat().st_size / 1e6)
    assert "train: 3 of 3 maps" in capsys.readouterr().out
    found = PackedMaps(path).load(torch.device("cpu"))
    for scene in range(3):
        labels = torch.from_numpy(Rectangles(3, seed=3).truth(scene).labels)
        assert torch.equal(found.labels[scene].int(), labels)


def test_other_data_are_refused(tmp_path):
    views = ViewSamples(StoredViews(Rectangles(), 3))
    with pytest.raises(ConfigError, match="dataset=tabletop_fused_maps"):
        PackMaps(SegmentationData(views, views), tmp_path / "maps.npz")
    with pytest.raises(ConfigError, match=r"run\.workers = 0"):
        PackMaps(data(), tmp_path / "maps.npz", workers=0)
