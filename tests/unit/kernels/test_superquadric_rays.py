"""Rays that meet superquadrics, against marching in small steps."""

import numpy as np
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.geometry import look_at, rotation_from_quaternion
from scenefw.core.types import Camera
from scenefw.kernels.cameras import stack_cameras
from scenefw.kernels.superquadric_rays import first_hits
from scenefw.shapes.superquadric import Superquadric


def scene(seed=0, objects=3):
    rng = np.random.default_rng(seed)
    turns = [rotation_from_quaternion(q / np.linalg.norm(q)) for q in rng.normal(size=(objects, 4))]
    arrays = (
        rng.uniform(0.03, 0.12, (objects, 3)),
        np.exp(rng.uniform(np.log(1.6), np.log(60), (objects, 3))),
        np.stack(turns),
        rng.uniform([-0.15, -0.15, 0.05], [0.15, 0.15, 0.2], (objects, 3)),
    )
    tensors = [torch.from_numpy(one[None].astype(np.float32)) for one in arrays]
    return SceneParameters(*tensors, torch.ones(1, objects, dtype=torch.bool)), arrays


def looking(size=(24, 18), eye=(0.7, -0.4, 0.5)):
    eye, target = np.array(eye), np.array([0.0, 0.0, 0.1])
    return Camera().resized(*size).moved(look_at(eye, target))


def marched(arrays, camera, steps=1200, end=1.4, holes=None):
    """Depth and owner of the first sample of each ray in an object and in no hole of it."""
    v, u = np.mgrid[: camera.height, : camera.width]
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    rays = np.stack([x, y, np.ones(u.shape)], axis=-1)
    pose = camera.T_world_camera
    depth, owner = np.zeros(u.shape), np.zeros(u.shape, int)
    for z in np.linspace(0.5, end, steps):
        points = z * rays @ pose[:3, :3].T + pose[:3, 3]
        for k, (axes, exponents, turn, place) in enumerate(zip(*arrays, strict=True)):
            inside = Superquadric(axes, exponents).value((points - place) @ turn) < 1
            if holes:
                axes, exponents, turn, place = (one[k] for one in holes)
                hole = Superquadric(axes, exponents).value((points - place) @ turn) < 1
                inside &= ~hole
            new = inside & (owner == 0)
            depth[new], owner[new] = z, k + 1
    return depth, owner


def test_the_first_object_of_each_ray_is_met_where_it_begins():
    parameters, arrays = scene()
    camera = looking()
    wanted, whose = marched(arrays, camera)
    depth, owners = (one[0].numpy() for one in first_hits(parameters, stack_cameras([camera])))
    same = owners == whose
    assert (owners > 0).sum() > 30
    assert same.mean() > 0.98  # rays that graze an object may differ
    assert np.abs(depth - wanted)[same].max() < 2e-3
    assert (depth[owners == 0] == 0).all()


def test_absent_objects_are_not_seen():
    parameters, _ = scene()
    camera = looking()
    none = SceneParameters(
        parameters.half_axes, parameters.exponents, parameters.rotations, parameters.positions,
        torch.zeros(1, 3, dtype=torch.bool),
    )  # fmt: skip
    _, owners = first_hits(none, stack_cameras([camera]))
    assert not owners.any()


def test_a_ray_through_an_opening_meets_the_far_wall():
    parameters, arrays = scene(seed=2)
    axes, exponents, turns, places = arrays
    up = np.abs(turns[:, 2]).argmax(axis=1)
    ahead = turns[np.arange(3), :, up] * np.sign(turns[np.arange(3), 2, up])[:, None]
    holes = (0.85 * axes, exponents, turns, places + 0.4 * axes.min(axis=1)[:, None] * ahead)
    tensors = [torch.from_numpy(one[None].astype(np.float32)) for one in holes]
    cut = SceneParameters(*tensors, torch.ones(1, 3, dtype=torch.bool))
    camera = looking((64, 48), (0.3, -0.2, 0.9))
    cameras = stack_cameras([camera])
    solid, _ = (one[0].numpy() for one in first_hits(parameters, cameras))
    wanted, whose = marched(arrays, camera, holes=holes)
    depth, owners = (one[0].numpy() for one in first_hits(parameters, cameras, cut))
    same = owners == whose
    assert same.mean() > 0.97
    assert np.quantile(np.abs(depth - wanted)[same], 0.99) < 2e-3
    assert (depth > solid + 0.01).sum() > 30
    none = SceneParameters(*tensors, torch.zeros(1, 3, dtype=torch.bool))
    assert torch.equal(first_hits(parameters, cameras, none)[0], first_hits(parameters, cameras)[0])
