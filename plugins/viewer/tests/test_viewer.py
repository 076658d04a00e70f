import json
import socket
import urllib.request
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from tests.unit.perception.pipelines import KnownBoxes, pipeline_of
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import rigid
from scenefw.core.ports import require_free
from scenefw.core.types import GridSpec
from scenefw.export.scene_files import GLB, PLY, Summary
from scenefw.perception.estimate.transforms import moved, without
from scenefw_simulators.mjcf import MJCF
from scenefw_simulators.urdf import URDF
from scenefw_viewer.layers import Prediction
from scenefw_viewer.server import open_server
from scenefw_viewer.viewer import Viewer

pytest.importorskip("viser")

CAMERA = camera_at(eye=(0.0, -0.85, 0.6), size=(160, 120))
FORMATS = {"glb": GLB(), "ply": PLY(), "json": Summary(), "urdf": URDF(), "mjcf": MJCF()}


class Lifting:
    """Stands for a simulation: object 1 ends 10 cm higher."""

    def settle(self, scenes):
        up = rigid(np.eye(3), (0, 0, 0.1))
        return [moved(scene, {1: up} if scene.objects else {}) for scene in scenes]


@pytest.fixture(scope="module")
def known():
    pipeline = pipeline_of(KnownBoxes(GridSpec(resolution=32)), samples=1)
    view = pipeline.observe(frame_of(CAMERA))
    (scene,) = pipeline.reconstruct(view)
    partial = view.partial.distance[0, 0].numpy()
    return Prediction((scene, without(scene, {2})), view.source, partial)


@pytest.fixture
def server():
    server = open_server("127.0.0.1", 0)
    yield server
    server.stop()


@pytest.fixture
def viewer(server, known, tmp_path):
    def load(number):
        if number == 1:
            raise InputError("second is unusable; give another")
        return known

    return Viewer(server, ["first", "second"], load, FORMATS, tmp_path, Lifting())


def nodes(viewer):
    return set(viewer.server.scene._handle_from_node_name)


def objects(viewer):
    return {name for name in nodes(viewer) if name.endswith("/surface") and "/objects" in name}


def visible(viewer, label):
    return viewer.server.scene._handle_from_node_name[f"/objects/{label}"].visible


def test_the_page_is_served(viewer):
    port = viewer.server.get_port()
    with urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=20) as page:
        assert b"<html" in page.read().lower()


def test_the_scene_holds_what_was_seen_and_predicted(viewer, known):
    wanted = {"/points/seen", "/truth/seen", "/floor/grid", "/camera/image", "/slice/partial"}
    assert wanted <= nodes(viewer)
    assert objects(viewer) == {"/objects/1/surface", "/objects/2/surface"}
    frame = viewer.server.scene._handle_from_node_name["/objects/2"]
    own = viewer.server.scene._handle_from_node_name["/objects/2/surface"].vertices
    item = known.scenes[0].objects[1]
    np.testing.assert_allclose(frame.position, item.pose.position)
    world = own @ item.pose.rotation.T + item.pose.position
    np.testing.assert_allclose(world, item.mesh.vertices, atol=1e-5)
    assert not viewer.stage.is_visible("slice")
    viewer.controls["slice"].value = True
    assert viewer.stage.is_visible("slice")


def test_the_slider_changes_hypotheses_and_keeps_changes(viewer):
    viewer.controls["object"].value = "object 2"
    viewer.remove()
    viewer.controls["hypothesis"].value = 2
    assert objects(viewer) == {"/objects/1/surface"}
    assert viewer.controls["object"].options == ("none", "object 1")
    viewer.controls["hypothesis"].value = 1
    assert not visible(viewer, 2)
    viewer.undo()
    assert visible(viewer, 2)


def test_objects_are_removed_and_put_back(viewer):
    viewer.remove()  # none is selected
    assert not viewer.edits.changed
    viewer.select(1)
    assert "/gizmo" in nodes(viewer)
    viewer.remove()
    assert not visible(viewer, 1)
    assert "/gizmo" not in nodes(viewer)
    assert viewer.controls["remove"].label == "Put back"
    viewer.remove()
    assert visible(viewer, 1)
    assert viewer.controls["remove"].label == "Remove"


@pytest.mark.parametrize("name", list(FORMATS))
def test_exports_are_of_what_is_shown(viewer, tmp_path, name):
    viewer.select(2)
    viewer.remove()
    path, *parts = viewer.export(name)
    assert path == tmp_path / "first" / f"scene{FORMATS[name].suffix}"
    assert path.stat().st_size > 100
    assert all(part.is_file() for part in parts)
    assert bool(parts) == (name == "urdf")
    if name == "json":
        assert [item["id"] for item in json.loads(path.read_text())["objects"]] == [1]
    if name == "glb":
        assert len(trimesh.load(path).geometry) == 1


def test_moved_objects_are_exported_where_they_are(viewer, known, tmp_path):
    item = known.scenes[0].objects[1]
    viewer.place(2, rigid(np.eye(3), (0.1, 0, 0)) @ item.pose.matrix)
    viewer.export("json")
    written = json.loads((tmp_path / "first" / "scene.json").read_text())["objects"][1]
    np.testing.assert_allclose(written["centre"], item.pose.position + (0.1, 0, 0), atol=1e-6)
    node = viewer.server.scene._handle_from_node_name["/objects/2"]
    np.testing.assert_allclose(node.position, written["centre"], atol=1e-6)


def test_settling_moves_what_is_there(viewer, known):
    viewer.select(2)
    viewer.remove()
    viewer.settle()
    height = known.scenes[0].objects[0].pose.position[2]
    np.testing.assert_allclose(viewer.edits.pose(1)[2, 3], height + 0.1)
    assert not visible(viewer, 2)
    viewer.undo()
    np.testing.assert_allclose(viewer.edits.pose(1)[2, 3], height)


def test_an_unusable_image_leaves_the_one_before(viewer, capsys):
    with pytest.raises(InputError, match="unusable"):
        viewer.choose_image(1)
    assert viewer.image == 0
    viewer.controls["image"].value = "second"
    assert "error: second is unusable; give another" in capsys.readouterr().err
    assert viewer.controls["image"].value == "first"
    assert objects(viewer)


def test_without_labels_there_is_no_truth(server, known, tmp_path):
    plain = replace(known, frame=replace(known.frame, labels=None))
    viewer = Viewer(server, ["plain"], lambda _: plain, FORMATS, tmp_path)
    assert "/truth/seen" not in nodes(viewer)
    assert not viewer.controls["truth"].visible
    assert "settle" not in viewer.controls


def test_a_port_in_use_is_one_line():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(ConfigError, match=rf"port {port} .* in use.*run\.port={port + 1}"):
            require_free("127.0.0.1", port)


@pytest.mark.parametrize(("host", "port"), [("127.0.0.1", 70000), ("no.such.invalid", 0)])
def test_wrong_hosts_and_ports_are_one_line(host, port):
    with pytest.raises(ConfigError, match=r"run\.(port|host) = "):
        require_free(host, port)


def test_only_this_machine_reaches_it(server):
    assert server.get_host() == "127.0.0.1"
    with socket.socket() as other:  # the port is free at the other addresses
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 0)
        other.bind(("127.0.0.2", server.get_port()))


def test_pages_of_other_servers_are_refused(server):
    """A browser sends the origin of a page with its WebSockets; programs send none."""
    client = pytest.importorskip("websockets.sync.client")
    refused = pytest.importorskip("websockets.exceptions").InvalidStatus
    port = server.get_port()
    address = f"ws://127.0.0.1:{port}"
    protocol = f"viser-v{pytest.importorskip('viser').__version__}"
    for origin in (None, f"http://127.0.0.1:{port}", f"http://localhost:{port}"):
        with client.connect(address, origin=origin, subprotocols=[protocol]) as connection:
            assert connection.recv(timeout=10)
    for origin in ("http://evil.example", f"http://127.0.0.1:{port + 1}", "null"):
        with pytest.raises(refused, match="403"):
            client.connect(address, origin=origin, subprotocols=[protocol])
