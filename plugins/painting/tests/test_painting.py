from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from scenefw.core.errors import ConfigError, InputError, StorageError
from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Camera, Frame
from scenefw.data.files.sequences import RGBDFolder
from scenefw_painting import height_map as maps
from scenefw_painting.pictures import (
    export_painting,
    load_painting,
    palette,
    without_borders,
    write_views,
)

GRID = HeightGrid(vertices=65, extent=0.32, lower=(-0.16, -0.16), levels=2)
CLASSES = ("surface", "coin", "pen")


def table():
    """A block in the middle of a table, of grey pixels and some that look like a class."""
    heights = np.zeros(GRID.shape, np.float32)
    heights[24:41, 20:45] = 0.03
    heights[:4] = np.nan
    colour = np.random.default_rng(0).integers(90, 110, (*GRID.shape, 3), dtype=np.uint8)
    colour[50, 50] = palette(CLASSES)[1]
    return replace(maps.empty(GRID), heights=heights, colour=colour)


def painted(folder, changes):
    """Paints rectangles (rows, columns, colour) over the exported picture."""
    picture = export_painting(folder, table(), CLASSES)
    with Image.open(picture) as image:
        values = np.array(image)
    for rows, columns, colour in changes:
        values[rows, columns] = colour
    Image.fromarray(values).save(picture)
    return picture


BLOCK = (slice(24, 41), slice(20, 45))


def labelled(folder):
    picture = painted(folder, [(*BLOCK, palette(CLASSES)[1])])
    return load_painting(picture, table(), background="surface")


def test_paint_comes_back_as_labels(tmp_path):
    picture = painted(tmp_path, [(*BLOCK, palette(CLASSES)[1]), (slice(60, 62), 7, (0, 255, 0))])
    loaded = load_painting(picture, table())
    expected = np.full(GRID.shape, -1)
    expected[BLOCK], expected[60:62, 7] = 1, 2
    np.testing.assert_array_equal(loaded.labels, expected)
    assert loaded.classes == CLASSES
    np.testing.assert_allclose(loaded.probabilities[:, 30, 30], (0, 1, 0))
    np.testing.assert_allclose(loaded.probabilities[:, 50, 50], 1 / 3)
    with_surface = load_painting(picture, table(), background="surface")
    np.testing.assert_array_equal(with_surface.labels[4:], np.where(expected < 0, 0, expected)[4:])
    assert (with_surface.labels[:4] == -1).all()  # unseen
    assert (tmp_path / "palette.png").is_file()


def test_an_untouched_picture_has_no_labels(tmp_path):
    assert (load_painting(export_painting(tmp_path, table(), CLASSES), table()).labels == -1).all()


def test_a_painting_is_never_replaced(tmp_path):
    picture = export_painting(tmp_path, table(), CLASSES)
    assert export_painting(tmp_path, table(), CLASSES) == picture  # nothing is lost
    picture = painted(tmp_path, [(*BLOCK, palette(CLASSES)[1])])
    before = picture.read_bytes()
    with pytest.raises(StorageError, match=r"colours\.png was painted on.*move it away"):
        export_painting(tmp_path, table(), CLASSES)
    assert picture.read_bytes() == before


def test_unknown_colours_are_listed_with_their_counts(tmp_path):
    picture = painted(tmp_path, [(slice(0, 2), slice(0, 5), (1, 2, 3)), (9, 9, (250, 0, 0))])
    with pytest.raises(
        InputError, match=r"11 pixels of 2 unknown.*\(1, 2, 3\): 10, \(250, 0, 0\): 1"
    ):
        load_painting(picture, table())


def test_mistakes_are_named(tmp_path):
    picture = export_painting(tmp_path, table(), CLASSES)
    with pytest.raises(InputError, match="background 'table' is not a class"):
        load_painting(picture, table(), background="table")
    (tmp_path / "palette.json").unlink()
    with pytest.raises(InputError, match=r"palette\.json"):
        load_painting(picture, table())
    Image.new("RGB", (8, 9)).save(picture)
    with pytest.raises(InputError, match="8 x 9 pixels, its height map 65 x 65"):
        load_painting(picture, table(), CLASSES)
    picture.write_bytes(b"no picture")
    with pytest.raises(InputError, match="cannot read painting"):
        load_painting(picture, table(), CLASSES)
    with pytest.raises(InputError, match="has no labels"):
        write_views(tmp_path, table(), [])
    with pytest.raises(ConfigError, match="99 classes"):
        palette(["x"] * 99)


def cameras():
    eyes = ((0.0, -0.1, 0.3), (0.1, 0.1, 0.25), (-0.4, 0.0, 0.3))  # the last one jumps
    return [Camera(T_world_camera=look_at(eye, (0, 0, 0))).resized(64, 48) for eye in eyes]


def test_views_are_labelled_and_read_back(tmp_path):
    known = labelled(tmp_path)
    read = RGBDFolder(write_views(tmp_path / "views", known, cameras(), border=1))
    assert len(read) == 3
    for frame, camera in zip(read, cameras(), strict=True):
        seen = maps.view(known, camera)
        np.testing.assert_allclose(frame.depth, seen.depth, atol=5.1e-4)
        np.testing.assert_array_equal(frame.colour, seen.colour)
        np.testing.assert_array_equal(frame.labels, without_borders(seen.labels, 1))
        np.testing.assert_allclose(frame.camera.T_world_camera, camera.T_world_camera, atol=1e-6)
        assert {0, 1} <= set(np.unique(frame.labels))


def test_borders_of_objects_are_ignored(tmp_path):
    known = labelled(tmp_path)
    plain, bordered = (
        RGBDFolder(write_views(tmp_path / str(border), known, cameras()[:1], border))[0].labels
        for border in (0, 2)
    )
    rows, columns = np.nonzero((plain == 1) & (bordered == -1))
    assert rows.size > 0
    for row, column in zip(rows, columns, strict=True):
        window = plain[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
        assert len(np.unique(window)) > 1
    kept = bordered >= 0
    np.testing.assert_array_equal(bordered[kept], plain[kept])


def test_key_frames_keep_their_own_images(tmp_path):
    known, camera = labelled(tmp_path), cameras()[0]
    depth = maps.view(known, camera).depth
    depth[depth > 0] += np.float32(0.002)
    depth[:10][depth[:10] > 0] += np.float32(0.1)  # something that isn't in the map
    colour = np.full((48, 64, 3), 7, np.uint8)
    frame = RGBDFolder(write_views(tmp_path / "v", known, [Frame(depth, camera, colour)], 0))[0]
    assert (frame.colour == 7).all()
    np.testing.assert_allclose(frame.depth, depth, atol=5.1e-4)
    assert (frame.labels[:10] == -1).all()
    assert (frame.labels[10:] >= 0).mean() > 0.5
