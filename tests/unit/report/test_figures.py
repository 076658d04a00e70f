"""Curves from CSV files and figures as SVG."""

from xml.etree import ElementTree

import pytest

from scenefw.core.errors import StorageError
from scenefw.report.figures import bin_figure, loss_figure, read_curves

CSV = """step,epoch,seconds,name,value
10,0,1.5,train/loss,2.5
10,0,1.5,train/tsdf,1.5
20,0,3.0,train/loss,2.0
20,0,3.0,train/tsdf,1.2
20,0,3.1,val/loss,2.2
"""


def _texts(svg):
    root = ElementTree.fromstring(svg)
    return {"".join(e.itertext()).strip() for e in root.iter("{http://www.w3.org/2000/svg}text")}


def test_curves_by_name(tmp_path):
    path = tmp_path / "metrics.csv"
    path.write_text(CSV)
    curves = read_curves(path)
    assert curves["train/loss"] == [(10, 2.5), (20, 2.0)]
    assert curves["val/loss"] == [(20, 2.2)]


def test_unusable_files_are_named(tmp_path):
    with pytest.raises(StorageError, match=r"none\.csv"):
        read_curves(tmp_path / "none.csv")
    odd = tmp_path / "odd.csv"
    odd.write_text("a,b\n1,2\n")
    with pytest.raises(StorageError, match="not a table of losses"):
        read_curves(odd)
    empty = tmp_path / "empty.csv"
    empty.write_text("")
    assert read_curves(empty) == {}


def test_loss_figure_has_a_panel_per_term(tmp_path):
    path = tmp_path / "metrics.csv"
    path.write_text(CSV)
    svg = loss_figure(read_curves(path))
    assert {"loss", "tsdf", "train", "val"} <= _texts(svg)
    assert "currentColor" in svg  # follows light and dark pages
    assert "#010203" not in svg


def test_bin_figure_skips_empty_bins():
    panels = {"IoU": {"ours": [0.5, None, 0.7]}, "BCE": {"theirs": [0.1, 0.2, 0.3]}}
    svg = bin_figure([0, 0.1, 0.2, 0.3], panels, "visible")
    assert {"ours", "theirs", "visible", "IoU", "BCE"} <= _texts(svg)
