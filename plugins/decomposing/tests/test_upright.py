"""A table says which way is up, in whatever axes a mesh is given."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from scenefw.core.types import TriangleMesh
from scenefw_decomposing.upright import table_normal, turned_upright

TABLE = ((0.7, 0.5, 0.02), (0.0, 0.0, -0.01))
BOXES = [((0.09, 0.1, 0.12), (0.1, 0.05, 0.06)), ((0.2, 0.06, 0.28), (-0.15, 0.1, 0.14))]
WALL = ((0.9, 0.02, 0.9), (0.0, 0.6, 0.45))  # larger than the table
AXES = {
    "+y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
    "+x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
    "-x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
}


def scene(*boxes, rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), flipped=False):
    parts = [
        trimesh.creation.box(sides, trimesh.transformations.translation_matrix(place))
        for sides, place in boxes
    ]
    mesh = trimesh.util.concatenate(parts)
    faces = np.asarray(mesh.faces)
    return TriangleMesh(
        np.asarray(mesh.vertices) @ np.asarray(rotation).T, faces[:, ::-1] if flipped else faces
    )


@pytest.mark.parametrize(
    ("axis", "flipped"),
    [*((axis, False) for axis in ("+x", "-y", "-z")), ("+y", True), ("-x", True)],
)
def test_a_table_along_any_axis_is_turned_up(axis, flipped):
    rotation = np.array(AXES[axis])
    turn, words = turned_upright(scene(TABLE, *BOXES, rotation=rotation, flipped=flipped))
    np.testing.assert_allclose((turn @ rotation)[:, 2], (0, 0, 1), atol=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert words == f"the table faces {axis} of the file, so the mesh was turned z up"


@pytest.mark.parametrize("seed", range(2))
def test_a_table_in_any_direction_is_found(seed):
    rotation = Rotation.random(rng=seed).as_matrix()
    normal = table_normal(scene(TABLE, *BOXES, rotation=rotation))
    np.testing.assert_allclose(normal, rotation[:, 2], atol=1e-6)


def test_noise_of_a_scan_is_borne():
    mesh = scene(TABLE, *BOXES, rotation=AXES["+y"])
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(5):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)
    noise = 0.0008 * np.random.default_rng(0).standard_normal(vertices.shape)
    turn, words = turned_upright(TriangleMesh(vertices + noise, faces))
    assert "+y" in words
    np.testing.assert_allclose(turn @ (0, 1, 0), (0, 0, 1), atol=1e-12)


@pytest.mark.parametrize(
    "boxes", [(TABLE, *BOXES), (TABLE, *BOXES, WALL), BOXES[:1], BOXES], ids=str
)
def test_what_is_z_up_or_has_no_table_stays(boxes):
    turn, words = turned_upright(scene(*boxes))
    np.testing.assert_array_equal(turn, np.eye(3))
    assert not words
