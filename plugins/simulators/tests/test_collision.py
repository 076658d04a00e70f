import numpy as np
import pytest
import trimesh

from scenefw.core.errors import ConfigError, MissingDependencyError
from scenefw.core.types import TriangleMesh
from scenefw.shapes.superquadric import Superquadric
from scenefw_simulators.collision import ConvexHull, ConvexParts


def bowl():
    """A cylinder, open above."""
    mesh = trimesh.creation.annulus(r_min=0.08, r_max=0.1, height=0.08)
    return TriangleMesh(np.array(mesh.vertices), np.array(mesh.faces))


def as_trimesh(mesh):
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


@pytest.mark.parametrize("exponents", [(2, 2, 2), (100, 100, 100), (2, 2, 100)])
@pytest.mark.parametrize("tolerance", [0.0005, 0.002])
def test_a_hull_has_few_corners_and_keeps_its_size(exponents, tolerance):
    mesh = Superquadric(np.array([0.06, 0.04, 0.1]), np.array(exponents, float)).mesh()
    (hull,) = (as_trimesh(one) for one in ConvexHull(tolerance).parts(mesh))
    whole = as_trimesh(mesh).convex_hull
    assert hull.is_watertight
    assert hull.is_convex
    assert hull.volume > 0
    assert len(hull.vertices) < min(500, len(whole.vertices))
    directions = trimesh.creation.icosphere(subdivisions=3).vertices
    gaps = (whole.vertices @ directions.T).max(axis=0) - (hull.vertices @ directions.T).max(axis=0)
    assert gaps.min() > -1e-9
    assert gaps.max() < 2 * tolerance  # between the directions in which it is held


@pytest.mark.exhaustive
def test_parts_keep_what_is_hollow_hollow():
    pytest.importorskip("coacd")
    mesh = bowl()
    parts = [as_trimesh(one) for one in ConvexParts(most=12).parts(mesh)]
    assert 3 <= len(parts) <= 12
    assert all(part.is_convex and part.volume > 0 for part in parts)
    (hull,) = ConvexHull().parts(mesh)
    assert sum(part.volume for part in parts) < 0.6 * as_trimesh(hull).volume


def test_settings_out_of_range_and_a_missing_library_are_one_line(monkeypatch):
    with pytest.raises(ConfigError, match="tolerance is 0"):
        ConvexHull(0)
    with pytest.raises(ConfigError, match=r"^concavity = 0: expected a number from"):
        ConvexParts(concavity=0)
    monkeypatch.setitem(__import__("sys").modules, "coacd", None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'scenefw\[parts\]'"):
        ConvexParts()
