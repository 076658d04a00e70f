"""Fused maps go into one file, and a training starts from that file alone."""

import pytest
import torch
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError
from scenefw_labelling_studies.pack_maps import PackMaps
from scenefw_labelling_studies.packed_maps import PackedMaps
from scenefw_sweeps.local import Local
from scenefw_tabletops.data.map_crops import StoredMaps


def splits():
    return StoredMaps(Rectangles(3, seed=3)), StoredMaps(Rectangles(1, seed=1))


def test_maps_are_packed(tmp_path, capsys):
    path = tmp_path / "maps.npz"
    figures = PackMaps(*splits(), path, Local(1)).run()
    assert figures["maps/train"] == 3
    assert figures["maps/validation"] == 1
    assert figures["mb"] == pytest.approx(path.stat().st_size / 1e6)
    assert "train: 3 of 3 maps" in capsys.readouterr().out
    found = PackedMaps(path).load(torch.device("cpu"))
    for scene in range(3):
        labels = torch.from_numpy(Rectangles(3, seed=3).truth(scene).labels)
        assert torch.equal(found.labels[scene].int(), labels)


def test_wrong_use(tmp_path):
    train, validation = splits()
    validation.classes = ("surface", "coin")
    with pytest.raises(ConfigError, match="differ"):
        PackMaps(train, validation, tmp_path / "maps.npz", Local(1))


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], "run=pack_maps needs a data set of height maps; give dataset=tabletop_fused_maps"),
        (["dataset=tabletop_views"], "give dataset=tabletop_fused_maps"),
        (["dataset=tabletop_fused_maps_packed"], "PackedMaps, which has no arrays"),
    ],
)
def test_other_data_are_refused_in_one_line(scenefw, tmp_path, words, expected):
    done = scenefw("run=pack_maps", *words, "device=cpu", "paths.output=out")
    assert done.returncode == 2
    assert expected in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "out").exists()
