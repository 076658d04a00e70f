"""Rays through triangles against brute force, open3d and numba's CUDA simulator."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from scenefw.core import tabletop
from scenefw.core.geometry import look_at, rotation_from_quaternion
from scenefw.core.tabletop import TabletopGeometry
from scenefw.core.types import Camera
from scenefw.kernels.meshes import NOTHING, TABLE, Tree
from scenefw.renderers.mesh_raycaster import MeshRaycaster


def soup(count, seed):
    """Small random triangles in a cube of 1 m above the table."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-0.5, 0.5, (count, 1, 3)) + [0, 0, 0.6]
    return (places + rng.normal(0, 0.08, (count, 3, 3))).astype(np.float32)


def random_rays(count, seed):
    rng = np.random.default_rng(seed)
    origins = rng.normal(0, 1, (count, 3)) + [0, 0, 0.6]
    targets = rng.uniform(-0.5, 0.5, (count, 3)) + [0, 0, 0.6]
    return np.concatenate([origins, targets - origins], axis=1).astype(np.float32)


def brute_force(corners, rays):
    """Least distance and its triangle by solving a 3x3 system for each pair, float64."""
    corners, rays = corners.astype(np.float64), rays.astype(np.float64)
    sides = corners[:, 1:] - corners[:, :1]
    best, hit = np.full(len(rays), np.inf), np.full(len(rays), NOTHING)
    for k, (corner, side) in enumerate(zip(corners[:, 0], sides, strict=True)):
        matrix = np.stack([-rays[:, 3:], *np.broadcast_to(side[:, None], (2, len(rays), 3))], -1)
        t, u, v = np.linalg.solve(matrix, (rays[:, :3] - corner)[..., None])[..., 0].T
        closer = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < best)
        best[closer], hit[closer] = t[closer], k
    return best, hit


@given(st.integers(0, 200), st.integers(0, 1000))
def test_casting_equals_brute_force(count, seed):
    corners, rays = soup(count, seed), random_rays(40, seed)
    tree = Tree(corners)
    distance, hit, place = (x.numpy() for x in tree.cast(torch.from_numpy(rays), table=False))
    best, expected = brute_force(corners, rays)
    numbers = np.concatenate([tree.order, [NOTHING, TABLE]])  # -2 and -1 from the end
    same = numbers[hit] == expected
    assert same.mean() >= 0.95  # a ray along an edge may fall either way
    found = same & (hit >= 0)
    assert np.allclose(distance[found], best[found], rtol=1e-4, atol=1e-5)
    assert (distance[hit == NOTHING] == 0).all()
    picked = corners[tree.order[hit[found]]].astype(np.float64) if found.any() else corners[:0]
    u, v = place[found].T.astype(np.float64)
    weights = np.stack([1 - u - v, u, v], axis=-1)
    points = rays[found, :3] + distance[found, None] * rays[found, 3:]
    assert np.allclose((weights[..., None] * picked).sum(axis=1), points, atol=1e-4)


def test_every_triangle_is_in_one_leaf():
    tree = Tree(soup(500, 1))
    links = tree.links.numpy()
    leaves = links[links[:, 2] > 0]
    held = np.concatenate([np.arange(first, first + count) for _, first, count in leaves])
    assert sorted(held) == list(range(500))
    assert sorted(tree.order) == list(range(500))
    assert (links[:, 0] > np.arange(len(links))).all()


def test_equal_triangles_make_a_leaf_of_any_size():
    tree = Tree(np.repeat(soup(1, 0), 50, axis=0))
    assert tree.links.numpy().tolist() == [[1, 0, 50]]


def test_the_table_is_hit_from_above_and_from_below():
    rays = torch.tensor([[0, 0, 2, 0, 0, -1], [0, 0, -1, 0, 0, 2], [0, 0, 2, 0, 0, 1.0]])
    distance, hit, _ = Tree(soup(0, 0)).cast(rays)
    assert distance.tolist() == [2, 0.5, 0]
    assert hit.tolist() == [TABLE, TABLE, NOTHING]


def test_casting_equals_open3d():
    o3d = pytest.importorskip("open3d")
    corners, rays = soup(3000, 5), random_rays(5000, 6)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(corners.reshape(-1, 3), np.arange(9000, dtype=np.uint32).reshape(-1, 3))
    expected = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    distance, hit, _ = (x.numpy() for x in Tree(corners).cast(torch.from_numpy(rays), table=False))
    both = (hit >= 0) & np.isfinite(expected)
    assert (both == np.isfinite(expected)).mean() > 0.999
    assert (np.abs(distance - expected)[both] < 1e-4).mean() > 0.999


def small_geometry():
    """A few triangles of two items with every kind of texture."""
    corners = soup(12, 3) * [0.3, 0.3, 0.2]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    rng = np.random.default_rng(0)
    textures = np.array(
        [[kind, 0.02, 0.8, 0.3, 0.1, 0.8, 0.3, 0.4] for kind in range(tabletop.PRINT + 1)]
    )
    turn = rotation_from_quaternion([0.9, 0.1, -0.2, 0.35])
    placements = np.array([[0.1, 0, 0.02, *turn.ravel(), 1.1], [0, 0.1, 0, *np.eye(3).ravel(), 1]])
    return TabletopGeometry(
        corners.astype(np.float32),
        np.repeat(normals[:, None], 3, axis=1).astype(np.float32),
        rng.uniform(0, 1, (12, 3)).astype(np.float32),
        np.arange(12, dtype=np.int32) % len(textures),
        np.repeat([0, 1], 6).astype(np.int32),
        np.array([2, 1], dtype=np.int32),
        placements.astype(np.float32),
        textures.astype(np.float32)[[4, 1, 2, 3, 0, *range(5, len(textures))]],
        np.array([0.5, 0.4, 0.3], dtype=np.float32),
        np.array([[0.5, 0.4, 1, 0.6, 0.6, 0.5], [-1, 0, 1, 0.2, 0.2, 0.3]], dtype=np.float32),
        np.array([0.3, 0.3, 0.3], dtype=np.float32),
    )


def results():
    """A view by name, small enough for the simulator."""
    camera = Camera(T_world_camera=look_at((0.1, -0.2, 0.4), (0, 0, 0.05))).resized(12, 9)
    frame = next(MeshRaycaster().frames(small_geometry(), [camera]))
    return {"depth": frame.depth, "labels": frame.labels, "colour": frame.colour}


def test_the_grid_of_threads_gives_what_the_loop_gives(simulated):
    expected = results()
    assert set(np.unique(expected["labels"])) == {0, 1, 2}
    assert (np.abs(simulated["depth"] - expected["depth"]) > 1e-4).mean() <= 0.02
    assert (simulated["labels"] != expected["labels"]).mean() <= 0.02
    away = np.abs(simulated["colour"].astype(int) - expected["colour"]).max(axis=-1)
    assert (away > 3).mean() <= 0.02
