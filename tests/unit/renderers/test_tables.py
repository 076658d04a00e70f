"""Batches of pictures of several scenes against pictures of one scene each, and the simulator."""

import numpy as np
import pytest
import torch
from tests.unit.kernels.test_meshes import small_geometry

from scenefw.core.geometry import look_at
from scenefw.core.height_maps import HeightGrid
from scenefw.core.types import Camera
from scenefw.renderers.mesh_raycaster import MeshRaycaster, image
from scenefw.renderers.tables import Tables, camera_lenses, map_lens, prepared
from scenefw_tabletops.scenes.tabletop import TabletopGenerator
from scenefw_tabletops.shapes.tabletop.library import ProceduralModels

EYES = ((0.1, -0.2, 0.4), (-0.15, 0.1, 0.35), (0.05, 0.05, 0.3))


def cameras(size):
    return [Camera(T_world_camera=look_at(eye, (0, 0, 0.05))).resized(*size) for eye in EYES]


def lenses(size):
    views = cameras(size)
    intrinsics = np.array([[c.fx, c.fy, c.cx, c.cy] for c in views])
    return torch.from_numpy(camera_lenses(intrinsics, np.stack([c.T_world_camera for c in views])))


def geometries():
    generator = TabletopGenerator(ProceduralModels(), minimum=3, maximum=4)
    return [small_geometry(), *(generator.geometry(generator.generate(i, 0)) for i in range(2))]


@pytest.mark.parametrize("size", [(48, 36), (97, 61)])
def test_a_batch_of_scenes_equals_each_alone(size):
    every = geometries()
    tables = Tables([prepared(g) for g in every], "cpu")
    order = torch.tensor([2, 0, 1], dtype=torch.int32)
    found = tables.render(order, lenses(size), size)
    for row, (scene, camera) in enumerate(zip(order.tolist(), cameras(size), strict=True)):
        frame = next(MeshRaycaster().frames(every[scene], [camera]))
        np.testing.assert_array_equal(found.labels[row], frame.labels)
        np.testing.assert_array_equal(found.distance[row], frame.depth)
        np.testing.assert_array_equal(image(found.colour[row]), frame.colour)


def test_lenses_are_cameras():
    camera = cameras((40, 30))[0]
    lens = lenses((40, 30))[0].numpy()
    u, v = 7.25, 20.5
    rays = lens[:18].reshape(2, 3, 3).transpose(0, 2, 1) @ [1, u, v]
    local = np.linalg.solve(camera.matrix, [u, v, 1])
    np.testing.assert_allclose(rays[0], EYES[0], atol=1e-12)
    np.testing.assert_allclose(rays[1], camera.T_world_camera[:3, :3] @ local, atol=1e-12)
    np.testing.assert_allclose(lens[18:], [0, 1 / camera.fx])


def test_a_lens_of_a_part_of_a_map_shows_that_part():
    grid, scene = HeightGrid(257), geometries()[1]
    whole = MeshRaycaster().height_map(scene, grid)
    tables = Tables([prepared(scene)], "cpu")
    top = float(tables.tops[0])
    lens = torch.from_numpy(map_lens(grid, top, row=90, column=100)[None])
    found = tables.render(torch.zeros(1, dtype=torch.int32), lens, (64, 48))
    part = slice(90, 138), slice(100, 164)
    np.testing.assert_array_equal(found.labels[0], whole.labels[part])
    np.testing.assert_allclose(top - found.distance[0], whole.heights[part], atol=1e-6)
    inner = slice(1, -1), slice(1, -1)  # the edge's pixels have fewer neighbours here
    away = image(found.colour[0])[inner].int() - torch.from_numpy(whole.colour[part][inner]).int()
    assert away.abs().max() <= 1


def results():
    """A batch of two scenes, small enough for the simulator."""
    size, first = (12, 9), small_geometry()
    tables = Tables([prepared(first), prepared(second_geometry())], "cpu")
    found = tables.render(torch.tensor([1, 0, 1], dtype=torch.int32), lenses(size), size)
    return {name: value.numpy() for name, value in vars(found).items()}


def second_geometry():
    """The first scene turned upside down in x, with labels and lamps of its own."""
    geometry = small_geometry()
    geometry.corners[..., 0] *= -1
    geometry.labels[:] = geometry.labels[::-1].copy()
    geometry.lights[:, 3:] *= 0.7
    return geometry


@pytest.mark.exhaustive
def test_the_grid_of_threads_gives_what_the_loop_gives(simulated):
    expected = results()
    assert set(np.unique(expected["labels"])) == {0, 1, 2}
    assert not np.array_equal(expected["labels"][0], expected["labels"][2])
    for name, tolerance in (("distance", 1e-4), ("labels", 0), ("colour", 3 / 255)):
        away = np.abs(simulated[name].astype(float) - expected[name])
        assert (away > tolerance).mean() <= 0.02, name


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")
def test_cuda_equals_cpu_and_waits_for_nothing():
    size, scenes = (97, 61), [prepared(g) for g in geometries()]
    order = torch.tensor([2, 0, 1], dtype=torch.int32)
    ours = Tables(scenes, "cpu").render(order, lenses(size), size)
    tables, where = Tables(scenes, "cuda"), (order.cuda(), lenses(size).cuda())
    tables.render(*where, size)  # compiled
    torch.cuda.set_sync_debug_mode("error")
    theirs = tables.render(*where, size)
    torch.cuda.set_sync_debug_mode("default")
    for name, tolerance in (("distance", 1e-4), ("labels", 0), ("colour", 3 / 255)):
        away = (getattr(ours, name).float() - getattr(theirs, name).cpu().float()).abs()
        assert (away > tolerance).float().mean() < 0.01, name
