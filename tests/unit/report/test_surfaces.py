"""Surfaces that pictures show, beside formulas and the volume's own picture."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from tests.unit.report.test_shading import CAMERA, ball

from scenefw.core.types import PlacedShape, Pose, TriangleMesh
from scenefw.report import shading
from scenefw.report.shading import draw
from scenefw.report.surfaces import Surfaces
from scenefw.shapes.superquadric import Superquadric
from scenefw.shapes.vessel import Vessel

UPRIGHT = np.array([1.0, 0, 0, 0])


def standing(shape, height):
    return PlacedShape(shape, Pose(np.array([0.0, 0.0, height]), UPRIGHT)).mesh()


def test_a_ball_has_its_depth_its_normals_and_its_label():
    mesh = standing(Superquadric([0.12] * 3, [2] * 3), 0.12)
    depth, normals, labels = Surfaces({3: mesh}).seen_from(CAMERA)
    on = labels == 3
    u, v = np.meshgrid(np.arange(96), np.arange(72))
    ahead = np.stack([(u - 47.5) / 110, (v - 35.5) / 110, np.ones(u.shape)], axis=-1)
    pose = CAMERA.T_world_camera
    points = pose[:3, 3] + depth[..., None] * (ahead @ pose[:3, :3].T)
    np.testing.assert_allclose(np.linalg.norm(points[on] - [0, 0, 0.12], axis=1), 0.12, atol=1e-3)
    np.testing.assert_allclose(normals[on], (points[on] - [0, 0, 0.12]) / 0.12, atol=0.05)
    floor = (labels == 0) & (depth > 0)
    np.testing.assert_allclose(points[floor][:, 2], 0, atol=1e-5)
    assert (normals[floor] == [0, 0, 1]).all()


def test_edges_of_a_box_stay_sharp():
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (0, 0.2)])
    faces = ConvexHull(corners).simplices  # normals may look inward: pictures turn them
    _, normals, labels = Surfaces({1: TriangleMesh(corners, faces)}).seen_from(CAMERA)
    found = np.unique(np.round(normals[labels == 1], 5), axis=0)
    assert (np.sort(np.abs(found), axis=1) == [0, 0, 1]).all()


def test_inner_surfaces_look_at_the_camera():
    mesh = standing(Vessel(0.15, 0.7, 1.0, 0.1, 0.004), 0.05)
    depth, normals, labels = Surfaces({1: mesh}).seen_from(CAMERA)
    pose = CAMERA.T_world_camera
    u, v = np.meshgrid(np.arange(96), np.arange(72))
    ahead = np.stack([(u - 47.5) / 110, (v - 35.5) / 110, np.ones(u.shape)], axis=-1)
    towards = (ahead @ pose[:3, :3].T)[labels == 1]
    assert (np.einsum("nk,nk->n", normals[labels == 1], towards) <= 1e-6).all()
    assert depth[labels == 1].min() > 0


@pytest.mark.parametrize("resolution", [32, 64])
def test_a_picture_of_the_surface_is_nearly_that_of_the_volume(resolution):
    solid = ball(resolution)
    mesh = standing(Superquadric([0.12] * 3, [2] * 3), 0.12)
    traced, surface = (
        draw(one, CAMERA) for one in (solid, replace(solid, surfaces=Surfaces({1: mesh})))
    )
    assert np.abs(traced - surface).mean() < 0.02
    assert np.corrcoef(traced.ravel(), surface.ravel())[0, 1] > 0.95


def test_four_rays_where_something_changes_are_as_good_as_four_everywhere(monkeypatch):
    camera = CAMERA.resized(384, 288)
    mesh = standing(Superquadric([0.12] * 3, [2] * 3), 0.12)
    solid = replace(ball(64), surfaces=Surfaces({1: mesh}))
    some = draw(solid, camera)
    counted = []
    varied = shading._varied

    def all_of_them(met, *more):
        counted.append(varied(met, *more).float())
        return met.depth >= 0

    monkeypatch.setattr(shading, "_varied", all_of_them)
    everywhere = draw(solid, camera)
    assert 0.01 < counted[0].mean() < 0.5
    assert np.abs(some - everywhere).mean() < 2e-3
    assert np.abs(some - everywhere).max() < 0.15
    monkeypatch.setattr(shading, "_varied", lambda met, *_: met.depth < 0)
    nowhere = draw(solid, camera)
    assert np.abs(nowhere - everywhere).mean() > 3 * np.abs(some - everywhere).mean()


def test_a_scene_without_objects_is_the_floor():
    depth, _, labels = Surfaces({}).seen_from(CAMERA)
    assert not labels.any()
    assert (depth > 0).any()


def test_light_falls_into_what_is_hollow():
    """Under a lid it is dark; in distances in which the vessel is open it isn't."""
    solid = ball(64)
    vessel = Vessel(0.15, 0.8, 1.0, 0.12, 0.006)
    local = solid.grid.centres() + [0.0, 0.0, vessel.bottom]
    filled, opened = vessel.filled_distance(local), vessel.wall_distance(local)
    limit = solid.grid.truncation
    surfaces = Surfaces({1: standing(vessel, -vessel.bottom)})
    tsdf, inside = np.clip(filled, -limit, limit).astype(np.float32), (filled < 0).astype(np.int32)
    shut = replace(solid, tsdf=tsdf, instances=inside, surfaces=surfaces)
    lit = replace(shut, hollow=np.minimum(opened, limit).astype(np.float32))
    pictures = [draw(one, CAMERA) for one in (shut, lit)]
    red = pictures[1][..., 0] - pictures[1][..., 2] > 0.1
    assert pictures[1][red].mean() > 1.1 * pictures[0][red].mean()
    assert np.abs(pictures[1] - pictures[0])[~red].max() < 0.35
