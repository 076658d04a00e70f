import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.geometry import rotation_from_quaternion
from scenefw.core.types import TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects, principal_pose


def box(sides, rotation, position):
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, position
    mesh = trimesh.creation.box(sides, transform)
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces))


@given(st.integers(0, 10_000))
def test_box_gives_back_its_pose_and_sides(seed):
    random = np.random.default_rng(seed)
    sides = np.array([0.3, 0.2, 0.1]) * random.uniform(0.9, 1.1)
    rotation = rotation_from_quaternion(random.normal(size=4))
    position = random.uniform(-0.3, 0.3, 3)
    (item,) = estimate_objects({4: box(sides, rotation, position)}, {4: 0.7})
    assert (item.id, item.confidence) == (4, 0.7)
    np.testing.assert_allclose(item.pose.position, position, atol=1e-9)
    np.testing.assert_allclose(item.extents, sides, atol=1e-9)
    np.testing.assert_allclose(np.abs(item.pose.rotation.T @ rotation), np.eye(3), atol=1e-6)
    assert np.linalg.det(item.pose.rotation) == pytest.approx(1)
    assert item.pose.quaternion[0] >= 0


def test_centre_of_mass_is_that_of_the_solid():
    """A cone's vertices are not spread as its volume is; trimesh is the independent reference."""
    cone = trimesh.creation.cone(0.1, 0.3)
    cone.apply_transform(trimesh.transformations.rotation_matrix(1.0, (0.3, -0.5, 0.8)))
    cone.apply_translation((0.1, -0.2, 0.3))
    pose = principal_pose(TriangleMesh(np.array(cone.vertices), np.array(cone.faces)))
    np.testing.assert_allclose(pose.position, cone.center_mass, atol=1e-9)
    axis = cone.principal_inertia_vectors[np.argmin(cone.principal_inertia_components)]
    assert abs(pose.rotation[:, 0] @ axis) == pytest.approx(1, abs=1e-6)


def test_flat_mesh_without_volume_has_a_pose():
    flat = TriangleMesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]]))
    pose = principal_pose(flat)
    assert np.isfinite(pose.matrix).all()


def test_order_and_missing_confidence():
    unit = box((0.1, 0.2, 0.3), np.eye(3), (0, 0, 0))
    items = estimate_objects({2: unit, 1: unit}, {1: 0.5})
    assert [(item.id, item.confidence) for item in items] == [(1, 0.5), (2, 0.0)]
