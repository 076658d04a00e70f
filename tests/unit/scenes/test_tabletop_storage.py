"""Table-top scenes on disk come back exactly; damage is told."""

import dataclasses

import numpy as np
import pytest

from scenefw.core.errors import StorageError
from scenefw.core.tabletop import SMALL_OBJECTS
from scenefw.scenes.tabletop import TabletopGenerator
from scenefw.scenes.tabletop_storage import load_tabletops, save_tabletops
from scenefw.shapes.tabletop.library import ProceduralModels

GENERATOR = TabletopGenerator(ProceduralModels())
SCENES = [GENERATOR.generate(index, 3) for index in (0, 5, 646)]
EMPTY = dataclasses.replace(SCENES[0], items=(), lights=())


@pytest.mark.parametrize("scenes", [SCENES, SCENES[:1], [EMPTY, SCENES[1], EMPTY]])
def test_scenes_come_back_exactly(tmp_path, scenes):
    assert load_tabletops(save_tabletops(tmp_path / "tables.npz", scenes)) == scenes


def test_no_scene_at_all(tmp_path):
    assert load_tabletops(save_tabletops(tmp_path / "tables.npz", [])) == []


def test_what_is_no_file_of_scenes(tmp_path):
    with pytest.raises(StorageError, match="no table-top scenes at"):
        load_tabletops(tmp_path / "none.npz")
    path = save_tabletops(tmp_path / "tables.npz", SCENES)
    whole = path.read_bytes()
    for damaged in (b"", whole[:-200], b"x" * 100):
        path.write_bytes(damaged)
        with pytest.raises(StorageError, match="damaged"):
            load_tabletops(path)
    path.write_bytes(whole)
    with np.load(path) as file:
        arrays = dict(file)
    for name, wrong, said in (
        ("format", np.array(9), "format 9"),
        ("item_count", arrays["item_count"] + 1, "don't fit"),
        ("ambient", arrays["ambient"][:1], "don't fit"),
    ):
        np.savez(path, **{**arrays, name: wrong})
        with pytest.raises(StorageError, match=said):
            load_tabletops(path)


def test_one_set_of_classes_per_file(tmp_path):
    other = dataclasses.replace(SCENES[0], classes=SMALL_OBJECTS)
    with pytest.raises(StorageError, match="one set of classes"):
        save_tabletops(tmp_path / "tables.npz", [SCENES[0], other])
