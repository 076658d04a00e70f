"""Maps of recordings, painted and turned into labelled views."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from tests.unit.tasks.recordings import CLASSES, GRID, frames, table
from tests.unit.tasks.test_label import Perfect, complaint, elsewhere, label, sequence

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.height_maps import HeightGrid
from scenefw.data.files.height_maps import load_map, save_map
from scenefw.data.files.readers import read_frame
from scenefw.data.files.sequences import write_sequence
from scenefw.labelling.by_height import ByHeight
from scenefw.labelling.map_based import MapBased
from scenefw.mapping.height_fusion import HeightFusion
from scenefw.tasks.label import Label
from scenefw_painting.task import PaintExport, PaintImport

__all__ = ["elsewhere", "sequence"]  # fixtures


@pytest.mark.parametrize("world", ["sequence", "elsewhere", "bare"])
def test_views_are_labelled_where_the_map_has_them(request, world, sequence, tmp_path):
    """Whatever world a recording's poses are of, or if it has none."""
    tracking, folder = {}, sequence if world == "bare" else request.getfixturevalue(world)
    if world == "bare":
        (folder := tmp_path / "in").mkdir()
        for name in ("depth", "rgb", "intrinsics.json"):
            (folder / name).symlink_to(sequence / name)
        tracking = {"estimate_poses": True, "odometry": Perfect()}
    maps = {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}
    label(folder, tmp_path / "out", maps, **tracking).run()
    path = tmp_path / "out" / "map.npz"
    PaintExport(path, tmp_path / "paint").run()
    names = json.loads((tmp_path / "paint" / "palette.json").read_text())
    fused = load_map(path).height_map
    with Image.open(tmp_path / "paint" / "colours.png") as image:
        painted = np.array(image)
    painted[fused.labels == 0] = names["surface"]
    painted[fused.labels > 0] = names["keyboard"]
    picture = tmp_path / "paint" / "painted.png"
    Image.fromarray(painted).save(picture)
    figures = PaintImport(picture, path, tmp_path / "labelled", views=folder).run()
    assert figures["views"] == 6
    if world == "bare":  # a map of a part of it
        part = tmp_path / "part" / "map.npz"
        label(folder, part.parent, maps, frames=2, **tracking).run()
        fused = load_map(part).height_map
        canvas = fused.colour.copy()
        canvas[fused.seen] = names["surface"]
        Image.fromarray(canvas).save(tmp_path / "paint" / "part.png")
        importing = PaintImport(tmp_path / "paint" / "part.png", part, tmp_path / "two", folder)
        assert importing.run()["views"] == 2
    right = known = 0
    for i, frame in enumerate(frames()):
        with Image.open(tmp_path / "labelled" / "views" / "labels" / f"{i:06d}.png") as image:
            labels = np.array(image)
        told = (labels != 255) & (frame.labels >= 0)
        known += told.mean() / 6
        right += ((labels > 0) == (frame.labels > 0))[told].mean() / 6
    assert known > 0.5
    assert right > 0.98
    if world == "elsewhere":
        saved = load_map(path)
        states = {name: state for name, state in saved.states.items() if name != "recording"}
        old = save_map(tmp_path / "old.npz", saved.height_map, states)
        with pytest.raises(InputError, match="that the map was made of"):
            PaintImport(picture, old, tmp_path / "lost", views=folder).run()
        assert not (tmp_path / "lost" / "views").exists()


def test_views_to_label_are_read_as_those_of_the_map(sequence, tmp_path):
    """Depth in half millimetres, and intrinsics elsewhere."""
    shutil.copytree(sequence, folder := tmp_path / "fine")
    for file in (folder / "depth").iterdir():
        with Image.open(file) as image:
            doubled = np.array(image).astype(np.uint16) * 2
        Image.fromarray(doubled).save(file)
    lens = (folder / "intrinsics.json").rename(tmp_path / "lens.json")
    told = {"depth_scale": 0.0005, "intrinsics": lens}
    maps = {"map_based": MapBased(HeightFusion(GRID), ByHeight(CLASSES, "keyboard"))}
    label(folder, tmp_path / "out", maps, **told).run()
    path = tmp_path / "out" / "map.npz"
    PaintExport(path, tmp_path / "paint").run()
    picture = tmp_path / "paint" / "colours.png"
    figures = PaintImport(
        picture, path, tmp_path / "in", folder, background="surface", **told
    ).run()
    assert figures["views"] == 6
    with pytest.raises(InputError):
        PaintImport(picture, path, tmp_path / "off", folder, intrinsics=lens).run()


@pytest.mark.parametrize(("setting", "value"), [("every", 0), ("every", -1), ("border", -1)])
def test_numbers_of_views_that_are_none_are_named(tmp_path, setting, value):
    with pytest.raises(ConfigError, match=rf"^{setting} = {value}: expected"):
        PaintImport("painted.png", "map.npz", tmp_path, "recording", **{setting: value})


def test_labels_by_hand_there_and_back(sequence, tmp_path):
    whole = table()
    save_map(tmp_path / "map.npz", whole)
    figures = PaintExport(tmp_path / "map.npz", tmp_path / "paint").run()
    assert figures["classes"] == 4
    names = json.loads((tmp_path / "paint" / "palette.json").read_text())
    with Image.open(tmp_path / "paint" / "colours.png") as image:
        painted = np.array(image)
    untouched = tmp_path / "paint" / "colours.png"
    with pytest.raises(InputError, match=r"nothing is painted in .*colours\.png"):
        PaintImport(untouched, tmp_path / "map.npz", tmp_path / "none").run()
    assert not list((tmp_path / "none").iterdir())
    for i, name in enumerate(CLASSES):
        painted[whole.labels == i] = names[name]
    picture = tmp_path / "paint" / "painted.png"
    Image.fromarray(painted).save(picture)
    out = tmp_path / "labelled"
    figures = PaintImport(picture, tmp_path / "map.npz", out, views=sequence, every=2).run()
    assert figures["views"] == 3
    assert figures["share/keyboard"] == pytest.approx(np.mean(whole.labels == 2))
    np.testing.assert_array_equal(load_map(out / "labelled.npz").height_map.labels, whole.labels)
    assert len(list((out / "views" / "labels").iterdir())) == 3
    with pytest.raises(ConfigError, match=r"map\.npz"):
        PaintImport(picture, None, out)
    with pytest.raises(ConfigError, match=r"map\.npz"):
        PaintExport(None, out)


def test_paint_of_no_class_is_told(scenefw, tmp_path):
    other = replace(table(), classes=("surface", "coin", "pen", "book"))
    save_map(tmp_path / "coins.npz", other)
    PaintExport(tmp_path / "coins.npz", tmp_path / "paint").run()
    Image.fromarray(np.full((129, 129, 3), 7, np.uint8)).save(tmp_path / "paint" / "wrong.png")
    words = ("run=paint_import", "input=paint/wrong.png", "run.map=coins.npz", "paths.output=out")
    line = complaint(scenefw, *words)
    assert "(7, 7, 7): 16641" in line


def test_views_of_a_real_image_are_labelled_in_its_own_world(real_data, tmp_path):
    """Its camera is the world of its poses, which is not the table's."""
    image = read_frame(real_data / "real" / "realsense_table" / "uois_1.npz")
    shown = write_sequence(tmp_path / "in", [image] * 3)
    maps = {"map_based": MapBased(HeightFusion(HeightGrid(129)), ByHeight(CLASSES, "keyboard"))}
    Label(shown, maps, HeightGrid(129), tmp_path / "rest", picture_every=None).run()
    PaintExport(tmp_path / "rest" / "map.npz", tmp_path / "paint").run()
    picture, path = tmp_path / "paint" / "colours.png", tmp_path / "rest" / "map.npz"
    importing = PaintImport(picture, path, tmp_path / "out", shown, background="surface")
    assert importing.run()["views"] == 3
    with Image.open(tmp_path / "out" / "views" / "labels" / "000002.png") as labels:
        assert np.mean(np.array(labels) == 0) > 0.2  # of all pixels; the map is a metre wide
