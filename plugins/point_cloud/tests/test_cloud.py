import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.geometry import look_at
from scenefw.core.types import Camera, Frame
from scenefw_point_cloud.cloud import PointCloud, palette
from scenefw_point_cloud.representation import PointClouds

CENTRE, RADIUS = np.array([0.02, -0.01, 0.15]), 0.12


def sphere_frame(width):
    """Depth of a sphere by the closed form, seen from aside."""
    camera = Camera().resized(width, width * 3 // 4).moved(look_at((0.8, -0.3, 0.5), CENTRE))
    v, u = np.indices((camera.height, camera.width))
    rays = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1
    )
    centre = camera.T_world_camera[:3, :3].T @ (CENTRE - camera.T_world_camera[:3, 3])
    a, b = np.sum(rays**2, -1), rays @ centre
    root = b**2 - a * (centre @ centre - RADIUS**2)
    depth = np.where(root > 0, (b - np.sqrt(np.maximum(root, 0))) / a, 0)
    return Frame(depth.astype(np.float32), camera, labels=(root > 0).astype(np.int32), name="ball")


def angle(normals, truth):
    return np.degrees(np.arccos(np.clip(np.sum(normals * truth, -1), -1, 1)))


@pytest.mark.parametrize(("width", "median"), [(160, 0.5), (480, 0.15)])
def test_depth_of_a_sphere_gives_points_and_normals_on_it(width, median):
    frame = sphere_frame(width)
    cloud = PointClouds().of_frame(frame)
    outward = cloud.points - CENTRE
    np.testing.assert_allclose(np.linalg.norm(outward, axis=1), RADIUS, atol=1e-5)
    errors = angle(cloud.normals, outward / RADIUS)
    assert np.median(errors) < median
    assert np.percentile(errors, 95) < 20 * median
    assert len(cloud) > 0.96 * np.sum(frame.depth > 0)
    assert set(cloud.labels) == {1}


def test_normals_of_a_plane_are_exact_up_to_an_edge():
    camera = Camera(80, 60, 70, 70, 39.5, 29.5, look_at((0.5, 0, 0.7), (0, 0, 0)))
    v, u = np.indices((60, 80))
    rays = np.stack(
        [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(u.shape)], -1
    )
    slope = rays @ camera.T_world_camera[2, :3]
    depth = -0.7 / slope
    depth[:, 40:] -= 0.2  # a second, nearer surface: normals must not bridge the two
    cloud = PointClouds().of_frame(Frame(depth.astype(np.float32), camera))
    plane_mask = cloud.points[:, 2] < 1e-4
    assert plane_mask.sum() == 40 * 60
    assert angle(cloud.normals[plane_mask], np.array([0, 0, 1])).max() < 0.2


def test_strides_take_every_nth_pixel():
    frame = sphere_frame(160)
    full_cloud, sparse_cloud = PointClouds().of_frame(frame), PointClouds(stride=2).of_frame(frame)
    assert len(sparse_cloud) == pytest.approx(len(full_cloud) / 4, rel=0.05)


def test_ply_is_read_back_by_another_library(tmp_path):
    cloud = PointClouds(stride=3).of_frame(sphere_frame(160))
    cloud.save(tmp_path / "ball.ply")
    ply = trimesh.load(tmp_path / "ball.ply")
    np.testing.assert_allclose(ply.vertices, cloud.points, atol=1e-6)
    stored = ply.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_allclose(np.ravel(stored["nx"]), cloud.normals[:, 0], atol=1e-6)
    np.testing.assert_array_equal(np.ravel(stored["label"]), cloud.labels)


def test_labels_have_colours_of_their_own():
    colours = palette(np.arange(-1, 12, dtype=np.int32))
    assert len(np.unique(colours, axis=0)) == 12
    np.testing.assert_array_equal(colours[0], colours[1])


def test_bad_input_is_named():
    camera = Camera(4, 3)
    with pytest.raises(InputError, match="no depth"):
        PointClouds().of_frame(Frame(np.full((3, 4), np.nan, np.float32), camera))
    with pytest.raises(ConfigError, match="stride=0"):
        PointClouds(stride=0)
    with pytest.raises(InputError, match="normals"):
        PointCloud(np.zeros((2, 3)), np.zeros((1, 3)), np.zeros(2, int), np.zeros((2, 3), "u1"))
