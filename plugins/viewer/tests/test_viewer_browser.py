"""The viewer in Chromium, as somebody sees it."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of
from tests.unit.tasks.recordings import table

from scenefw.core.types import GridSpec
from scenefw.export.scene_files import GLB
from scenefw.perception.estimate.transforms import without
from scenefw_viewer.layers import Prediction
from scenefw_viewer.map_viewer import MapViewer
from scenefw_viewer.server import open_server
from scenefw_viewer.viewer import Viewer


@pytest.fixture
def viewer(tmp_path):
    pytest.importorskip("viser", reason="pip install 'scenefw[viewer]'")
    pipeline = pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=1)
    view = pipeline.observe(frame_of(camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))))
    (scene,) = pipeline.reconstruct(view)
    scenes = (scene, without(scene, {2}))
    known = Prediction(scenes, view.source, view.partial.distance[0, 0].numpy())
    server = open_server("127.0.0.1", 0)
    yield Viewer(server, ["boxes"], lambda _: known, {"glb": GLB()}, tmp_path / "out")
    server.stop()


@pytest.fixture
def map_viewer():
    pytest.importorskip("viser", reason="pip install 'scenefw[viewer]'")
    server = open_server("127.0.0.1", 0)
    yield MapViewer(server)
    server.stop()


def shares(page):
    """Of the colours of objects 1 and 2 in the 3D picture: blue and orange."""
    picture = Image.open(io.BytesIO(page.locator("canvas").first.screenshot()))
    red, green, blue = np.moveaxis(np.asarray(picture.convert("RGB"), np.int32), -1, 0)
    orange = (red > 120) & (red - green > 35) & (green - blue > 35)
    blue_one = (blue > 90) & (blue - red > 60)
    return float(blue_one.mean()), float(orange.mean())


def until(page, holds):
    """The picture follows what was done after a while."""
    for _ in range(60):
        page.wait_for_timeout(500)
        if holds(*shares(page)):
            return True
    return False


@pytest.mark.exhaustive
def test_it_loads_the_slider_changes_the_picture_and_an_export_arrives(page, viewer, tmp_path):
    complaints = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(f"http://127.0.0.1:{viewer.server.get_port()}")
    page.get_by_text("hypothesis").first.wait_for()
    assert until(page, lambda one, two: one > 0.005 and two > 0.005)
    page.screenshot(path=tmp_path / "loaded.png")
    slider = page.get_by_role("slider").first
    slider.focus()
    slider.press("ArrowRight")
    assert until(page, lambda one, two: one > 0.005 and two < 0.004)  # a notice has an orange bar
    assert viewer.hypothesis == 1
    page.reload()  # a browser that goes away loses nothing
    page.get_by_text("hypothesis").first.wait_for()
    assert viewer.hypothesis == 1
    with page.expect_download() as arriving:
        page.get_by_role("button", name="Export", exact=True).last.click()
    file = Path(tmp_path / "arrived.glb")
    arriving.value.save_as(file)
    assert len(trimesh.load(file).geometry) == 1
    assert file.read_bytes() == (tmp_path / "out/boxes/hypothesis_2/scene.glb").read_bytes()
    assert not complaints


@pytest.mark.exhaustive
def test_a_map_grows_in_the_page_and_the_slider_goes_back(page, map_viewer, tmp_path):
    """The keyboard, orange, lies right of the columns that are seen at first."""
    heights = table().heights.copy()
    heights[:, 45:] = np.nan
    map_viewer.show(replace(table(), heights=heights), "1 frame")
    page.goto(f"http://127.0.0.1:{map_viewer.server.get_port()}")
    page.get_by_text("1 frame").wait_for()
    assert until(page, lambda one, two: one > 0.001 and two < 0.004)
    map_viewer.show(table(), "2 frames")
    page.get_by_text("2 frames").wait_for()
    assert until(page, lambda one, two: two > 0.01)
    slider = page.get_by_role("slider").first
    slider.focus()
    slider.press("ArrowLeft")
    assert until(page, lambda one, two: two < 0.004)
    assert not map_viewer.controls["follow"].value
    with page.expect_download() as arriving:
        page.get_by_role("button", name="Save as GLB").click()
    arriving.value.save_as(tmp_path / "map.glb")
    assert (tmp_path / "map.glb").read_bytes() == map_viewer.export()
