"""Packed maps against the maps that went in; damaged files and limits."""

import zipfile

import numpy as np
import pytest
import torch
from tests.unit.data import damaged
from tests.unit.data.rectangles import Rectangles

from scenefw.core.errors import ConfigError, StorageError
from scenefw_labelling_studies.packed_maps import STEP, PackedMaps, packed, save_maps, unpacked
from scenefw_tabletops.data.map_crops import MapCrops, StoredMaps

CPU = torch.device("cpu")


def smooth():
    """A map with a slope, an unseen corner and heights below the table."""
    y, x = np.mgrid[:200, :200].astype(np.float32)
    colour = np.stack([x + 20, y + 10, 200 - x], axis=-1).clip(0, 255).astype(np.uint8)
    heights = 0.0003 * x - 0.02 + 0.01 * np.sin(y / 9)
    labels = (x > 90).astype(np.int8) * 3
    heights[:30, :30], labels[:30, :30] = np.nan, -1
    colour[:30, :30] = 0
    return colour, heights.astype(np.float32), labels


def test_a_map_survives_packing():
    colour, heights, labels = smooth()
    content = packed(colour, heights, labels)
    found = unpacked(content)
    assert len(content) < 0.2 * (colour.nbytes + heights.nbytes + labels.nbytes)
    np.testing.assert_array_equal(found[2], labels)
    np.testing.assert_array_equal(np.isnan(found[1]), np.isnan(heights))
    np.testing.assert_allclose(found[1], heights, atol=0.51 * STEP)
    seen = labels >= 0
    assert np.abs(found[0].astype(int) - colour)[seen].mean() < 3
    assert not found[0][~seen].any()
    assert [a.dtype for a in found] == [np.uint8, np.float32, np.int8]


def write(path, megabytes=None):
    source = Rectangles(3)
    maps = StoredMaps(source)
    contents = [packed(*maps.arrays(scene)) for scene in range(3)]
    splits = ("validation", "train", "train")
    held = save_maps(
        path, zip(splits, contents, strict=True), maps.classes, megabytes, {"frames": 7}
    )
    return held, contents


class LastTwo(StoredMaps):
    """The maps of the training split of `write`, from their source."""

    def __init__(self):
        super().__init__(Rectangles(2))

    def arrays(self, scene):
        return StoredMaps(Rectangles(3)).arrays(scene + 1)


def test_a_file_holds_both_splits(tmp_path):
    held, _ = write(tmp_path / "maps.npz")
    assert held == {"validation": 1, "train": 2}
    train = PackedMaps(tmp_path / "maps.npz")
    assert len(train) == 2
    assert train.classes == Rectangles.classes
    assert len(PackedMaps(tmp_path / "maps.npz", limit=1)) == 1
    assert train.facts() == {"frames": 7}
    found, expected = (
        MapCrops(maps, 3, (24, 16)).batch(np.arange(6), 1, CPU) for maps in (train, LastTwo())
    )
    assert torch.equal(found.labels, expected.labels)
    torch.testing.assert_close(found.distance, expected.distance, atol=0.51 * STEP, rtol=0)
    for limit in (0, -1):
        with pytest.raises(ConfigError, match="limit"):
            PackedMaps(tmp_path / "maps.npz", limit=limit)
    whole = train.load(CPU)
    np.testing.assert_array_equal(whole.labels[1], Rectangles(3).truth(2).labels)
    np.testing.assert_allclose(whole.heights[1], Rectangles(3).truth(2).heights, atol=0.51 * STEP)


def test_a_file_has_a_largest_size(tmp_path):
    path = tmp_path / "maps.npz"
    _, contents = write(path)
    limit = (sum(map(len, contents[:2])) + 3 * 1000 + 10) / 1e6
    held, _ = write(path, limit)
    assert held == {"validation": 1, "train": 1}
    assert path.stat().st_size <= limit * 1e6
    with pytest.raises(StorageError, match="no map fits"):
        write(path, 1e-4)


def test_missing_damaged_and_wrong_files(tmp_path):
    path = tmp_path / "maps.npz"
    with pytest.raises(StorageError, match="run=pack_maps"):
        PackedMaps(path)
    write(path)
    with pytest.raises(ConfigError, match="no maps of the split 'test'"):
        PackedMaps(path, "test")
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(StorageError, match="damaged"):
        PackedMaps(path)


@pytest.mark.parametrize("kind", damaged.KINDS)
def test_damaged_archives_are_one_line(tmp_path, kind):
    path = damaged.write(tmp_path / "maps.npz", kind, {"facts": np.zeros(3, np.uint8)})
    with pytest.raises(StorageError, match="damaged") as raised:
        PackedMaps(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("facts", [b"[]", b"{}", b'{"format": 2}'])
def test_facts_that_say_nothing_are_damaged(tmp_path, facts):
    np.savez(tmp_path / "maps.npz", facts=np.frombuffer(facts, np.uint8))
    with pytest.raises(StorageError, match="damaged"):
        PackedMaps(tmp_path / "maps.npz")


def test_a_map_that_is_no_picture_is_damaged(tmp_path):
    path = tmp_path / "maps.npz"
    write(path)
    maps = PackedMaps(path)
    with zipfile.ZipFile(path) as file:
        content = {name: file.read(name) for name in file.namelist()}
    with zipfile.ZipFile(path, "w") as file:
        for name, data in content.items():
            cut = name != "facts.npy"
            file.writestr(name, data[:200] + b"\0" * (len(data) - 200) if cut else data)
    with pytest.raises(StorageError, match="damaged"):
        maps.load(torch.device("cpu"))
