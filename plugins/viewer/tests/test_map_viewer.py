import io
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.unit.tasks.recordings import frames, table

from scenefw_viewer import map_viewer
from scenefw_viewer.map_viewer import MapViewer
from scenefw_viewer.server import open_server

pytest.importorskip("viser")


@pytest.fixture
def viewer():
    server = open_server("127.0.0.1", 0)
    yield MapViewer(server, "waiting")
    server.stop()


def seen(columns):
    """The table, of which the first columns were seen."""
    heights = table().heights.copy()
    heights[:, columns:] = np.nan
    return replace(table(), heights=heights)


def about(viewer):
    return viewer.controls["about"].content


def test_the_latest_map_is_shown_until_somebody_goes_back(viewer):
    assert "waiting" in about(viewer)
    for columns in (20, 60, 100):
        viewer.show(seen(columns), f"{columns} frames", next(frames(1)))
    assert viewer.number == 2
    assert "100 frames" in about(viewer)
    assert "keyboard" in about(viewer)
    assert viewer.controls["map"].max == 3
    viewer.controls["map"].value = 1  # as somebody who drags it
    viewer._slide()
    assert not viewer.controls["follow"].value
    viewer.show(seen(129), "129 frames")
    assert viewer.number == 0
    assert "20 frames" in about(viewer)
    viewer.controls["map"].value = 4
    viewer._slide()
    assert viewer.controls["follow"].value
    assert "100% seen" in about(viewer)


def test_the_saved_file_is_the_shown_surface(viewer):
    viewer.show(seen(40), "40 frames")
    first = trimesh.load(io.BytesIO(viewer.export()), file_type="glb", force="mesh")
    viewer.show(seen(129), "129 frames")
    viewer.paint("colour")
    second = trimesh.load(io.BytesIO(viewer.export()), file_type="glb", force="mesh")
    assert len(second.faces) > 3 * len(first.faces)
    assert second.bounds[1][2] == pytest.approx(0.03)
    image = np.asarray(second.visual.material.baseColorTexture)[..., :3]
    np.testing.assert_array_equal(image, table().colour)


def test_of_a_long_recording_every_second_map_goes_and_the_latest_stays(viewer, monkeypatch):
    monkeypatch.setattr(map_viewer, "_MOST", 8)
    for number in range(50):
        viewer.show(table(), str(number))
        assert viewer.shots[-1].title == str(number)
        assert len(viewer.shots) <= 9
    kept = [int(shot.title) for shot in viewer.shots]
    assert kept[:-1] == list(range(0, kept[-2] + 1, kept[1]))
    assert viewer.number == len(kept) - 1


def test_a_map_of_nothing_and_one_without_labels_are_shown(viewer):
    nothing = replace(table(), heights=np.full_like(table().heights, np.nan), labels=None)
    viewer.show(nothing, "0 frames")
    assert "0% seen" in about(viewer)
    viewer.show(replace(table(), labels=None), "1 frame")
    assert viewer.look == "colour"
    assert "surface" not in about(viewer)


def test_it_says_what_goes_on(viewer):
    viewer.say("all <done>")
    assert "all &lt;done&gt;" in about(viewer)
