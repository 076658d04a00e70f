"""Scenes to turn: what a browser gets and what it draws."""

import base64
import gzip
import json
import re
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from scenefw.core.types import Camera, Frame, GridSpec, Obstacle, SceneEstimate, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects
from scenefw.report.blocks import Section
from scenefw.report.page import Page, write_scene_page
from scenefw.report.publication import publish
from scenefw.report.scenes3d import Layer, Scene3D, Solid, layer, packed

EYE = np.array([[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 1.5], [0, 0, 0, 1]], dtype=np.float64)


def solid(name, mesh):
    return Solid(name, (0.1, 0.4, 0.9), TriangleMesh(mesh.vertices, mesh.faces.astype(np.int64)))


BOX = solid("1: box", trimesh.creation.box((0.2, 0.1, 0.3)))
BALL = solid("2: </script> ball", trimesh.creation.icosphere(subdivisions=2, radius=0.1))


@pytest.fixture
def scene():
    depth = np.full((6, 8), 1.5, np.float32)
    depth[0] = 0
    colour = np.arange(6 * 8 * 3, dtype=np.uint8).reshape(6, 8, 3)
    frame = Frame(depth, Camera(8, 6, 8.0, 8.0, 3.5, 2.5, EYE), colour, name="view")
    return Scene3D("view", (Layer("predicted", (BOX,)), Layer("truth", (BOX, BALL))), frame)


def unpacked(block):
    header = json.loads(json.dumps(block.header))
    data = gzip.decompress(base64.b64decode(block.data))

    def array(place, kind):
        return np.frombuffer(data, kind, place[1], place[0])

    return header, array


def test_meshes_come_back_to_a_tenth_of_a_millimetre(scene):
    header, array = unpacked(packed([scene]))
    layers = header["scenes"][0]["layers"]
    assert [layer["name"] for layer in layers] == ["predicted", "truth"]
    for shown, given in zip(layers[1]["solids"], (BOX, BALL), strict=True):
        steps = array(shown["vertices"], "<i2").reshape(-1, 3)
        vertices = np.cumsum(steps, axis=0, dtype=np.int16) * header["unit"]
        np.testing.assert_allclose(vertices, given.mesh.vertices, atol=0.51e-4)
        faces = np.cumsum(array(shown["faces"], "<i4"), dtype=np.int32).reshape(-1, 3)
        np.testing.assert_array_equal(faces, given.mesh.faces)
        assert shown["name"] == given.name


def test_points_are_where_the_camera_measured_them_in_their_colours(scene):
    header, array = unpacked(packed([scene]))
    points = header["scenes"][0]["points"]
    positions = array(points["positions"], "<i2").reshape(-1, 3) * header["unit"]
    assert len(positions) == 5 * 8  # the first row has no measurement
    np.testing.assert_allclose(positions[:, 2], 0, atol=1e-4)  # 1.5 m below the camera
    np.testing.assert_allclose(positions[0, :2], [-3.5 / 8 * 1.5, 1.5 / 8 * 1.5], atol=1e-4)
    colours = array(points["colours"], "u1").reshape(-1, 3)
    np.testing.assert_array_equal(colours, scene.frame.colour[1:].reshape(-1, 3))
    np.testing.assert_allclose(header["scenes"][0]["eye"], [0, 0, 1.5])


def test_large_images_are_thinned():
    depth = np.full((60, 80), 1.0, np.float32)
    large = Frame(depth, Camera(80, 60, 80.0, 80.0, 39.5, 29.5, EYE))
    header, array = unpacked(packed([Scene3D("view", (), large)], max_points=500))
    points = header["scenes"][0]["points"]
    assert 300 <= points["positions"][1] / 3 <= 500
    assert array(points["colours"], "u1").reshape(-1, 3).std(axis=0).max() == 0  # one grey


def test_what_is_too_far_to_be_packed_is_left_out(scene):
    far = Frame(np.full((6, 8), 40.0, np.float32), scene.frame.camera)
    header, _ = unpacked(packed([Scene3D("view", (), far)]))
    assert header["scenes"][0]["points"]["positions"][1] == 0


def test_a_page_has_the_viewer_once_and_loads_nothing(tmp_path, scene):
    blocks = (packed([scene]), packed([scene], "again"))
    text = Page().write(tmp_path, [Section("Examples", blocks)], {}).read_text("utf-8")
    assert text.count("Copyright 2010-2022 Three.js Authors") == 1
    assert text.count("<figure class=scenes>") == 2
    assert not re.search(r"(src|href)=\"?http", text)
    assert len(text) < 1_000_000


def test_a_page_without_scenes_stays_small(tmp_path):
    text = Page().write(tmp_path, [Section("Examples", ())], {}).read_text("utf-8")
    assert "THREE" not in text


def test_documents_leave_scenes_out(tmp_path, scene):
    target = tmp_path / "page.md"
    publish(target, "Results", [Section("Examples", (packed([scene]),))], tmp_path, {})
    assert "Examples" not in target.read_text("utf-8")


@pytest.mark.parametrize(("number", "name", "solids"), [(0, "predicted", 1), (1, "truth", 2)])
@pytest.mark.exhaustive
def test_a_browser_draws_the_chosen_layer(tmp_path, scene, page, number, name, solids):
    path = tmp_path / "scene.html"
    write_scene_page(path, "view", packed([scene]))
    page.goto(f"{path.as_uri()}#layer={number}")
    page.wait_for_selector(".stage[data-layer], .sorry", state="attached")
    dom = page.content()
    drawn = (BOX, BALL)[:solids]
    assert f'data-layer="{name}"' in dom
    assert f'data-triangles="{sum(len(one.mesh.faces) for one in drawn)}"' in dom
    assert 'data-points="40"' in dom
    assert dom.count('class="tag"') == solids
    assert 'class="sorry"' not in dom


@pytest.fixture
def stacked(scene):
    """A ball on a box, beside a wall; a second hypothesis has no ball."""
    graph = {
        "objects": [
            {"id": 1, "stands_on": [0], "falls": [2]},
            {"id": 2, "stands_on": [1], "falls": []},
        ],
        "removal_order": [2, 1],
    }
    wall = trimesh.creation.box((2.0, 0.02, 1.0)).apply_translation((0, 0.5, 0.5))
    obstacle = Obstacle("wall", TriangleMesh(wall.vertices, wall.faces.astype(np.int64)))
    layers = (Layer("predicted", (BOX, BALL), graph), Layer("hypothesis 2", (BOX,)))
    return Scene3D("view", layers, scene.frame, (obstacle,))


def test_obstacles_come_back_without_what_is_too_far(stacked):
    mesh = stacked.obstacles[0].mesh
    far = replace(mesh, vertices=mesh.vertices * (10, 1, 1))
    for obstacle, faces in ((mesh, 12), (far, 0)):
        wall = Obstacle("wall", obstacle)
        header, array = unpacked(packed([replace(stacked, obstacles=(wall,))]))
        (shown,) = header["scenes"][0]["obstacles"]
        assert shown["name"] == "wall"
        assert shown["faces"][1] == 3 * faces
        steps = array(shown["vertices"], "<i2").reshape(-1, 3)
        assert len(steps) == len(mesh.vertices)


def test_a_layer_says_what_its_objects_stand_on():
    box = trimesh.creation.box((0.2, 0.2, 0.1))
    meshes = {
        label: TriangleMesh(box.vertices + (0, 0, height), box.faces.astype(np.int64))
        for label, height in ((1, 0.05), (2, 0.15))
    }
    grid = GridSpec(8)
    empty = np.zeros(grid.shape)
    frame = Frame(np.ones((6, 8), np.float32), Camera(8, 6, 8.0, 8.0, 3.5, 2.5, EYE))
    estimate = SceneEstimate(
        estimate_objects(meshes, {1: 0.5, 2: 0.5}), grid, empty, empty.astype(np.int32), frame
    )
    colours = [(1, 0, 0), (0, 1, 0)]
    assert layer("predicted", estimate, colours).supports == {
        "objects": [
            {"id": 1, "stands_on": [0], "falls": [2]},
            {"id": 2, "stands_on": [1], "falls": []},
        ],
        "removal_order": [2, 1],
    }
    assert layer("truth", estimate, colours, supports=False).supports is None


def open_page(page, path, scene):
    write_scene_page(path, "view", packed([scene]))
    page.goto(path.as_uri())
    page.wait_for_selector(".stage[data-layer]", state="attached")


def triangles(page, count):
    page.wait_for_function(
        f"document.querySelector('.stage').dataset.triangles === '{count}'", timeout=60_000
    )


@pytest.mark.exhaustive
def test_a_browser_says_what_carries_what_and_shows_obstacles(tmp_path, stacked, page):
    open_page(page, tmp_path / "scene.html", stacked)
    panel = page.locator(".panel")
    text = panel.inner_text()
    assert "on the floor; 2 would fall with it" in text
    assert "on 1" in text
    assert "take away in this order: 2 → 1" in text
    objects = len(BOX.mesh.faces) + len(BALL.mesh.faces)
    triangles(page, objects + 2 * 12)  # both sides of the wall
    panel.get_by_label("obstacles: wall").uncheck()
    triangles(page, objects)
    panel.get_by_label("rods to what carries each").check()
    triangles(page, objects + 2 * 12)  # two rods of six sides
    panel.get_by_label("hypothesis").fill("1")
    triangles(page, len(BOX.mesh.faces))
    assert "order" not in panel.inner_text()


@pytest.mark.exhaustive
def test_a_phone_shows_the_scene_and_opens_the_panel_below_it(tmp_path, stacked, page):
    page.set_viewport_size({"width": 390, "height": 844})
    open_page(page, tmp_path / "scene.html", stacked)
    panel = page.locator(".panel")
    assert panel.get_attribute("open") is None
    closed = panel.bounding_box()
    assert closed["height"] < 60
    assert closed["y"] + closed["height"] == pytest.approx(844, abs=1)
    places = [page.locator(".tag", has_text=label).bounding_box() for label in ("1", "2")]
    for place in places:  # the whole scene is in view
        assert 0 < place["x"] < 390 - place["width"]
        assert 0 < place["y"] < closed["y"]
    panel.locator("summary").click()
    page.wait_for_function("document.querySelector('.panel').offsetHeight > 200")
    opened = panel.bounding_box()
    assert opened["x"] == 0
    assert opened["width"] == pytest.approx(390, abs=1)
    assert opened["height"] <= 0.46 * 844
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
