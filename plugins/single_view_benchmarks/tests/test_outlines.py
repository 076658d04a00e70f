"""Polygons of LabelMe as labels of pixels, beside the sides of triangles."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.errors import ConfigError, LabelsError
from scenefw_single_view_benchmarks.outlines import Outlines

SQUARE = [[10, 5], [30, 5], [30, 20], [10, 20]]


def shape(points, label="cup", group=None, kind="polygon"):
    return {"label": label, "points": points, "group_id": group, "shape_type": kind}


def labels(folder, *shapes, size=(40, 60), name="a.rgb.json", outlines=None):
    content = {"imageHeight": size[0], "imageWidth": size[1], "shapes": list(shapes)}
    (folder / name).write_text(json.dumps(content))
    return (outlines or Outlines()).of(folder / "a.npz")


@given(st.lists(st.tuples(st.floats(1, 58), st.floats(1, 38)), min_size=3, max_size=3))
def test_pixels_within_a_triangle(tmp_path_factory, corners):
    found = labels(tmp_path_factory.mktemp("one"), shape(corners)) > 0
    v, u = np.indices(found.shape)
    following = corners[1:] + corners[:1]
    sides = [
        (b[0] - a[0]) * (v - a[1]) - (b[1] - a[1]) * (u - a[0])
        for a, b in zip(corners, following, strict=True)
    ]
    least, most = np.min(sides, axis=0), np.max(sides, axis=0)
    assert found[(least > 1e-6) | (most < -1e-6)].all()
    assert not found[(least < -1e-6) & (most > 1e-6)].any()


def test_a_square_of_pixels(tmp_path):
    found = labels(tmp_path, shape(SQUARE))
    assert found.dtype == np.int32
    assert (found[6:20, 11:30] == 1).all()
    assert not found[:5].any()
    assert not found[:, 31:].any()


def test_later_ones_lie_in_front_and_groups_are_one(tmp_path):
    over = [[20, 0], [40, 0], [40, 39], [20, 39]]
    far = [[50, 5], [58, 5], [58, 20]]
    found = labels(tmp_path, shape(SQUARE, group=7), shape(over), shape(far, group=7))
    assert (found[10, 12], found[10, 25], found[7, 56]) == (1, 2, 1)
    found = labels(tmp_path, shape(over), shape(SQUARE))
    assert (found[10, 25], found[30, 30]) == (2, 1)


def test_ignored_ones_are_unknown(tmp_path):
    found = labels(tmp_path, shape(SQUARE, "ignore"), shape([[40, 5], [50, 5], [50, 20]]))
    assert found[10, 20] == -1
    assert found[6, 48] == 1


def test_files_are_found_by_name(tmp_path):
    folder = tmp_path / "outlines"
    folder.mkdir()
    assert Outlines().of(tmp_path / "a.npz") is None
    assert Outlines(folder).of(tmp_path / "a.npz") is None
    assert labels(tmp_path, shape(SQUARE), name="a.json") is None  # may hold intrinsics
    (folder / "a.json").write_text((tmp_path / "a.json").read_text())
    assert Outlines(folder).of(tmp_path / "a.npz").max() == 1
    assert Outlines(str(folder)).of(tmp_path / "b.npz") is None


def test_the_set_that_ships(real_data):
    outlines = Outlines("realsense_table")
    images = sorted((real_data / "real" / "realsense_table").glob("*.npz"))
    counts = []
    for image in images:
        found = outlines.of(image)
        assert found.shape == (480, 640)
        counts.append(len(np.unique(found[found > 0])))
    assert counts == [10, 10, 9, 10, 4, 3, 13, 5, 10]


def test_a_set_that_ships_comes_before_a_folder_of_its_name(tmp_path, monkeypatch):
    """As images may lie in a folder of that name, where no outlines are."""
    (tmp_path / "realsense_table").mkdir()
    monkeypatch.chdir(tmp_path)
    assert Outlines("realsense_table").of(tmp_path / "uois_0.npz") is not None
    with pytest.raises(ConfigError, match="no folder ''"):
        Outlines("")


def test_wrong_files_are_one_line(tmp_path):
    with pytest.raises(ConfigError, match="realsense_table"):
        Outlines("tables")
    for wrong, words in (
        ("{", "cannot read"),
        ("[]", "LabelMe"),
        ('{"imageHeight": 40, "imageWidth": 60}', "shapes"),
        ('{"imageHeight": 0, "imageWidth": 60, "shapes": []}', "60 x 0"),
        ('{"imageHeight": 1e999, "imageWidth": 60, "shapes": []}', "infinity"),
        ("[" * 100000, "cannot read"),
        ('{"imageHeight": 40000, "imageWidth": 60000, "shapes": []}', "60000 x 40000"),
    ):
        (tmp_path / "a.rgb.json").write_text(wrong)
        with pytest.raises(LabelsError, match=words):
            Outlines().of(tmp_path / "a.npz")
    with pytest.raises(LabelsError, match="a circle, no polygon"):
        labels(tmp_path, shape(SQUARE[:2], kind="circle"))
    with pytest.raises(LabelsError, match="three corners x, y or more"):
        labels(tmp_path, shape(SQUARE[:2]))
    with pytest.raises(LabelsError, match="group_id is"):
        labels(tmp_path, shape(SQUARE, group=[1]))
    with pytest.raises(LabelsError, match="far outside"):
        labels(tmp_path, shape([[0, 0], [1e19, 0], [2, 2]]))
    with pytest.raises(LabelsError, match="isn't a number"):
        labels(tmp_path, shape([[0, 0], [1, float("nan")], [2, 2]]))
