import json

import numpy as np
import pytest

from scenefw.core.types import (
    Camera,
    Frame,
    GridSpec,
    ObjectEstimate,
    Pose,
    SceneEstimate,
    TriangleMesh,
)
from scenefw.export.summary import plain, write_summary


@pytest.fixture
def estimate():
    grid = GridSpec(resolution=8)
    mesh = TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    pose = Pose(np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.5, 0.5, 0.5]))
    item = ObjectEstimate(3, mesh, pose, np.array([0.3, 0.2, 0.1], dtype=np.float32), 0.75)
    camera = Camera(width=5, height=4, fx=6, fy=7, cx=2, cy=1.5)
    frame = Frame(np.ones((4, 5), dtype=np.float32), camera, name="view")
    details = {"floor": {"normal": np.array([0, 0, 1.0]), "share": np.float32(0.5)}, "warnings": ()}
    volume = np.zeros(grid.shape, dtype=np.float32)
    return SceneEstimate((item,), grid, volume, volume.astype(np.int32), frame, details)


def test_scene_json(tmp_path, estimate):
    write_summary(
        tmp_path / "scene.json", estimate, {3: "object_03.ply"}, versions={"scenefw": "1"}
    )
    scene = json.loads((tmp_path / "scene.json").read_text())
    (item,) = scene["objects"]
    assert item["id"] == 3
    assert item["centre"] == item["pose"]["position"] == [0.1, -0.2, 0.3]
    assert item["pose"]["quaternion"] == [0.5] * 4
    assert item["extents"] == pytest.approx([0.3, 0.2, 0.1])
    assert item["confidence"] == 0.75
    assert item["mesh"] == "object_03.ply"
    assert scene["camera"]["fx"] == 6
    assert scene["camera"]["T_world_camera"] == np.eye(4).tolist()
    assert scene["floor"] == {"normal": [0, 0, 1], "share": 0.5}
    assert scene["warnings"] == []
    assert scene["versions"] == {"scenefw": "1"}
    assert scene["name"] == "view"


def test_plain_has_nothing_that_json_lacks():
    value = {1: np.arange(3), "a": (np.nan, np.inf, np.int64(4), True), "b": {None}, "c": object}
    found = plain(value)
    assert found["1"] == [0, 1, 2]
    assert found["a"] == [None, None, 4, True]
    assert found["b"] == [None]
    json.dumps(found, allow_nan=False)
