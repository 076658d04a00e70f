import numpy as np
import pytest

from scenefw.core.types import ObjectEstimate, Pose, TriangleMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_editing.sizes import size, volume


def test_extents_are_in_whole_centimetres():
    mesh = TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))
    pose = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
    item = ObjectEstimate(1, mesh, pose, np.array([0.1, 0.052, 0.3]), 1.0)
    assert size(item) == "10 × 5 × 30 cm"


def test_volumes_of_ellipsoids_and_of_flat_meshes():
    axes = np.array([0.03, 0.04, 0.05])
    ball = Superquadric(axes, np.full(3, 2.0)).mesh()
    assert volume(ball) == pytest.approx(4 / 3 * np.pi * np.prod(axes), rel=0.03)
    assert volume(TriangleMesh(np.zeros((3, 3)), np.array([[0, 1, 2]]))) == 0
