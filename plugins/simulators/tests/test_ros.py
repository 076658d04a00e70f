import json
from dataclasses import replace

import numpy as np
import yaml
from scipy.spatial.transform import Rotation
from tests.unit.export.stacks import COLOURS, SIZES, stack
from tests.unit.perception.estimate.test_base_frame import POSE

from scenefw.core.types import Obstacle, TriangleMesh
from scenefw.perception.estimate.base_frame import floor_pose, in_base, with_camera_in_base
from scenefw_simulators.ros import Detections, PlanningScene

WALL = TriangleMesh(np.array([[0, 0.4, 0], [0.3, 0.4, 0], [0, 0.4, 0.3]]), np.array([[0, 1, 2]]))


def written(folder, form, estimate):
    path = folder / f"scene{form.suffix}"
    form.write(path, estimate, COLOURS)
    message = json.loads(path.read_text())
    assert yaml.safe_load(path.with_suffix(".yaml").read_text()) == message
    return message


def points(vertices):
    return np.array([[vertex[axis] for axis in "xyz"] for vertex in vertices])


def placed(pose, vertices):
    turn = Rotation.from_quat([pose["orientation"][axis] for axis in "xyzw"])
    return turn.apply(vertices) + points([pose["position"]])


def test_a_planning_scene_has_objects_obstacles_and_the_table_where_they_are(tmp_path):
    estimate = replace(stack(), obstacles=(Obstacle("wall", WALL),))
    message = written(tmp_path, PlanningScene(), estimate)
    assert message["is_diff"]
    assert message["robot_state"] == {"is_diff": True}
    items = {item["id"]: item for item in message["world"]["collision_objects"]}
    assert sorted(items) == ["object_01", "object_02", "object_03", "obstacle_01", "table"]
    assert {item["header"]["frame_id"] for item in items.values()} == {"table"}
    for item, size in zip(estimate.objects, SIZES, strict=True):
        (mesh,) = items[f"object_{item.id:02d}"]["meshes"]
        vertices = points(mesh["vertices"])
        np.testing.assert_allclose(sorted(np.ptp(vertices, axis=0)), sorted(size), atol=1e-5)
        there = placed(items[f"object_{item.id:02d}"]["pose"], vertices)
        np.testing.assert_allclose(there.min(axis=0), item.mesh.vertices.min(axis=0), atol=1e-5)
        corners = [triangle["vertex_indices"] for triangle in mesh["triangles"]]
        assert np.max(corners) == len(vertices) - 1
    np.testing.assert_allclose(points(items["obstacle_01"]["meshes"][0]["vertices"]), WALL.vertices)
    table = items["table"]
    assert table["primitives"][0]["type"] == 1
    top = table["pose"]["position"]["z"] + table["primitives"][0]["dimensions"][2] / 2
    assert abs(top) < 1e-9


def test_in_a_robots_base_everything_is_there(tmp_path):
    estimate = in_base(with_camera_in_base(stack(), POSE))
    message = written(tmp_path, PlanningScene(), estimate)
    items = {item["id"]: item for item in message["world"]["collision_objects"]}
    assert items["object_01"]["header"]["frame_id"] == "base_link"
    up = np.array([[0, 0, items["table"]["primitives"][0]["dimensions"][2] / 2]])
    top = placed(items["table"]["pose"], up)[0]
    floor = floor_pose(estimate.details)
    assert abs((np.linalg.inv(floor) @ [*top, 1.0])[2]) < 1e-5


def test_detections_have_poses_boxes_and_scores(tmp_path):
    estimate = stack()
    message = written(tmp_path, Detections(frame_id="odom", class_id="box"), estimate)
    assert message["header"]["frame_id"] == "odom"
    for detection, item in zip(message["detections"], estimate.objects, strict=True):
        assert detection["id"] == f"object_{item.id:02d}"
        (result,) = detection["results"]
        assert result["hypothesis"] == {"class_id": "box", "score": float(item.confidence)}
        assert len(result["pose"]["covariance"]) == 36
        size = np.array([detection["bbox"]["size"][axis] for axis in "xyz"])
        np.testing.assert_allclose(size, item.extents, atol=1e-6)
        half = (item.mesh.vertices - item.pose.position) @ item.pose.rotation
        corners = placed(detection["bbox"]["center"], half)
        np.testing.assert_allclose(corners, item.mesh.vertices, atol=1e-5)


def test_a_scene_without_objects_is_a_table(tmp_path):
    empty = replace(stack(), objects=())
    message = written(tmp_path, PlanningScene(), empty)
    assert [item["id"] for item in message["world"]["collision_objects"]] == ["table"]
    assert written(tmp_path, Detections(), empty)["detections"] == []
