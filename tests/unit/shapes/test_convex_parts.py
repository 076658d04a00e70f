"""Division of an L, made of voxels, into convex parts."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull
from skimage.measure import marching_cubes

from scenefw.core.types import TriangleMesh
from scenefw.shapes.convex_parts import ConvexParts, fills_hull

OPEN3D_LATER = """
from tests.unit.shapes.test_convex_parts import ell
from scenefw.shapes.convex_parts import ConvexParts
assert ConvexParts().of(ell(4))
import open3d
"""


def ell(detail):
    """An L of 5 m^3, whose convex hull has 7 m^3; `detail` voxels make a metre."""
    solid = np.ones((3, 3, 1))
    solid[1:, 1:] = 0
    voxels = np.pad(solid.repeat(detail, 0).repeat(detail, 1).repeat(detail, 2), 1)
    vertices, faces, _, _ = marching_cubes(voxels, 0.5)
    return TriangleMesh(vertices / detail, faces[:, ::-1].astype(np.int64))


@pytest.mark.parametrize("detail", [4, 8])
def test_parts_of_an_l_fill_it(detail):
    pytest.importorskip("coacd")
    mesh = ell(detail)
    assert fills_hull(mesh) == pytest.approx(5 / 7, abs=0.03)
    parts = ConvexParts().of(mesh)
    assert len(parts) >= 2
    volume = trimesh.Trimesh(mesh.vertices, mesh.faces).volume
    assert sum(ConvexHull(part).volume for part in parts) == pytest.approx(volume, rel=0.05)


def test_a_convex_mesh_is_not_divided():
    box = trimesh.creation.box()
    assert ConvexParts().of(TriangleMesh(np.asarray(box.vertices), np.asarray(box.faces))) == ()


@pytest.mark.exhaustive
def test_open3d_can_be_imported_afterwards():
    pytest.importorskip("coacd")
    pytest.importorskip("open3d", exc_type=ImportError)
    subprocess.run([sys.executable, "-c", OPEN3D_LATER], check=True)
