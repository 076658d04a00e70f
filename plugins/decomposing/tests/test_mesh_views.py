"""Views of meshes: the table is found, and depth is what rays meet."""

import numpy as np
import pytest
from plugins.decomposing.tests.several import PAIR, TABLE, boxes

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.types import TriangleMesh
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.table_frame import TableFrame
from scenefw_decomposing.mesh_views import MeshViews
from scenefw_decomposing.surround import SurroundingCameras

VIEWS = MeshViews(SurroundingCameras(160, 120, ring=3), TableFrame(max_tilt=0.3, max_offset=0.002))


def moved(mesh, T):  # noqa: N803
    return TriangleMesh(geometry.transform_points(T, mesh.vertices), mesh.faces)


def to_pair(points):
    """Distance (N,) to the surface of the boxes or the table z = 0, by their formulas."""
    found = [np.abs(points[:, 2])]
    for sides, place in PAIR:
        away = np.abs(points - place) - np.asarray(sides) / 2
        outside = np.linalg.norm(away.clip(min=0), axis=1)
        found.append(np.abs(outside + away.max(axis=1).clip(max=0)))
    return np.min(found, axis=0)


def test_seen_points_lie_on_the_boxes_or_the_table():
    seen = VIEWS.see(boxes(*PAIR, table=TABLE), "pair")
    assert seen.note == "a plane of the mesh"
    assert len(seen.frames) == 4
    for frame in seen.frames:
        points = world_points(frame).reshape(-1, 3)
        points = points[~np.isnan(points[:, 2])]
        assert len(points) > 0.5 * frame.depth.size
        assert to_pair(points).max() < 1e-4
        assert (points[:, 2] > 0.01).sum() > 100


@pytest.mark.parametrize(("tilt", "height"), [(0.15, 0.7), (0.0, 0.02), (0.05, -0.02)])
def test_a_table_anywhere_becomes_the_floor(tilt, height):
    """Also one that is hardly off: objects begin a centimetre and a half above it."""
    c, s = np.cos(tilt), np.sin(tilt)
    T = geometry.rigid([[c, 0, s], [0, 1, 0], [-s, 0, c]], (0.4, -0.2, height))  # noqa: N806
    mesh = boxes(*PAIR, table=TABLE)
    seen = VIEWS.see(moved(mesh, T), "pair")
    assert seen.note == "a plane of the mesh"
    up = seen.T_table_mesh[:3, :3] @ T[:3, :3] @ (0, 0, 1)
    np.testing.assert_allclose(up, (0, 0, 1), atol=2e-3)
    top = geometry.transform_points(seen.T_table_mesh @ T, [[0.03, 0.0, 0.22]])
    assert top[0, 2] == pytest.approx(0.22, abs=2e-3)
    np.testing.assert_allclose(
        seen.mesh.vertices,
        geometry.transform_points(seen.T_table_mesh @ T, mesh.vertices),
        atol=1e-12,
    )


def test_without_a_table_things_stand_on_their_lowest_point():
    """The top of a box is a plane too, but there is something below it."""
    seen = VIEWS.see(moved(boxes(*PAIR), geometry.rigid(np.eye(3), (0, 0, 0.5))), "pair")
    assert seen.note == "at the lowest point of the mesh"
    assert seen.mesh.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
    assert seen.T_table_mesh[2, 3] == pytest.approx(-0.5, abs=1e-6)


def test_a_table_alone_holds_nothing():
    with pytest.raises(InputError, match="nothing of bare stands on the table"):
        VIEWS.see(boxes(TABLE), "bare")


def test_a_mesh_with_y_up_is_turned():
    y_up = geometry.rigid([[1, 0, 0], [0, 0, 1], [0, -1, 0]], (0.1, 0.2, 0.3))
    mesh = boxes(*PAIR, table=TABLE)
    seen = VIEWS.see(moved(mesh, y_up), "pair")
    assert "faces +y of the file" in seen.note
    table = geometry.transform_points(seen.T_table_mesh @ y_up, mesh.vertices)
    np.testing.assert_allclose(table[:, 2], mesh.vertices[:, 2], atol=2e-3)
    np.testing.assert_allclose(seen.mesh.vertices, table, atol=1e-12)
