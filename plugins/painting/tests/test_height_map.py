from dataclasses import replace

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Camera
from scenefw_painting import height_map as maps

GRID = HeightGrid(vertices=33, extent=0.32, lower=(-0.16, -0.16), levels=1)


def camera(eye, target, width=64, height=48):
    return Camera(T_world_camera=look_at(eye, target)).resized(width, height)


def with_heights(heights, **fields):
    return replace(maps.empty(GRID), heights=np.asarray(heights, np.float32), **fields)


def hills(seed=0):
    return np.random.default_rng(seed).uniform(0, 0.03, GRID.shape)


def test_an_empty_map_shows_nothing():
    frame = maps.view(maps.empty(GRID), camera((0, 0, 0.5), (0, 0, 0)))
    assert not maps.empty(GRID).seen.any()
    assert (frame.depth == 0).all()
    assert (frame.colour == 0).all()
    assert frame.labels is None


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.1, 0.6))
def test_a_plane_is_seen_at_its_depth(x, y, z):
    view = camera((x, y, z), (0.02, 0.01, 0.0))
    frame = maps.view(with_heights(np.full(GRID.shape, 0.01)), view)
    v, u = np.mgrid[: view.height, : view.width]
    local = np.stack([(u - view.cx) / view.fx, (v - view.cy) / view.fy, np.ones(u.shape)], -1)
    rays, eye = local @ view.T_world_camera[:3, :3].T, np.array([x, y, z])
    depth = (0.01 - z) / rays[..., 2]
    points = eye + depth[..., None] * rays
    far = np.abs(points[..., :2]).max(-1) - 0.16
    inside = (depth > 0) & (far < -1e-4)
    np.testing.assert_allclose(frame.depth[inside], depth[inside], rtol=1e-4)
    assert (frame.depth[(far > 1e-4) | (depth < 0)] == 0).all()


def test_hills_are_seen_as_by_brute_force():
    """Every ray against every triangle (Moeller and Trumbore 1997)."""
    heights, n = hills(), GRID.vertices
    vertices = np.concatenate([GRID.positions(), heights[..., None]], -1).reshape(-1, 3)
    at = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.concatenate(
        [np.stack([at, at + n + 1, at + 1], 1), np.stack([at, at + n, at + n + 1], 1)]
    )
    view = camera((0.2, -0.25, 0.15), (0, 0, 0), 24, 18)
    v, u = np.mgrid[: view.height, : view.width]
    local = np.stack([(u - view.cx) / view.fx, (v - view.cy) / view.fy, np.ones(u.shape)], -1)
    rays = (local @ view.T_world_camera[:3, :3].T).reshape(-1, 1, 3)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    away = view.T_world_camera[:3, 3] - a
    across = np.cross(rays, c - a)
    scale = ((b - a) * across).sum(-1)
    one = (away * across).sum(-1) / scale
    turned = np.cross(away, b - a)
    two = (rays * turned).sum(-1) / scale
    depth = ((c - a) * turned).sum(-1) / scale
    hit = (one >= 0) & (two >= 0) & (one + two <= 1) & (depth > 0)
    first = np.where(hit, depth, np.inf).min(axis=1)
    expected = np.where(np.isfinite(first), first, 0).reshape(view.height, view.width)
    got = maps.view(with_heights(heights), view).depth
    assert (expected > 0).mean() > 0.5
    assert (np.abs(got - expected) > 1e-4).mean() < 0.01


def test_colour_and_labels_are_those_of_the_nearest_vertex():
    rows, columns = np.indices(GRID.shape)
    colour = np.stack([rows * 7, columns * 7, 0 * rows], -1).astype(np.uint8)
    labels = (columns > 16).astype(np.int32)
    known = with_heights(np.zeros(GRID.shape), colour=colour, labels=labels)
    frame = maps.view(known, camera((0, 0, 0.25), (0, 1e-6, 0)))
    assert (frame.depth > 0).all()
    rows, columns = frame.colour[..., 0] // 7, frame.colour[..., 1] // 7
    assert (np.diff(columns.astype(int), axis=1) >= 0).all()  # x to the right
    assert (np.diff(rows.astype(int), axis=0) >= 0).all()  # y up
    np.testing.assert_array_equal(frame.labels, columns > 16)


def test_unseen_triangles_let_rays_pass():
    heights = np.zeros(GRID.shape)
    heights[10:20, 10:20] = np.nan
    known = with_heights(heights, labels=np.zeros(GRID.shape, np.int32))
    frame = maps.view(known, camera((0, 0, 0.3), (0, 1e-6, 0)))
    through = frame.depth == 0
    assert 0.02 < through.mean() < 0.3
    assert (frame.labels[through] == -1).all()
    assert (frame.labels[~through] == 0).all()
    assert torch.isfinite(torch.from_numpy(frame.depth)).all()
