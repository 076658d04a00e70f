"""Scenes for the tests and distances that owe nothing to the code under test."""

import numpy as np
import torch

from scenefw.core.batches import SceneParameters
from scenefw.core.geometry import random_quaternion, rotation_from_quaternion


def parameters(half_axes, exponents, rotations, positions, present=None) -> SceneParameters:
    """One batch from nested lists or arrays."""
    half_axes, exponents, rotations, positions = (
        torch.tensor(np.asarray(a), dtype=torch.float32)
        for a in (half_axes, exponents, rotations, positions)
    )
    shape = half_axes.shape[:2]
    present = torch.ones(shape, dtype=torch.bool) if present is None else torch.tensor(present)
    return SceneParameters(half_axes, exponents, rotations, positions, present)


def random_scenes(batch: int, count: int, seed: int, exponents=(2, 100)) -> SceneParameters:
    """Objects as the thesis has them, tossed around the centre, overlaps allowed."""
    rng = np.random.default_rng(seed)
    low, high = np.log(exponents)
    rotations = [
        [rotation_from_quaternion(random_quaternion(rng)) for _ in range(count)]
        for _ in range(batch)
    ]
    return parameters(
        rng.uniform(0.025, 0.15, (batch, count, 3)),
        np.exp(rng.uniform(low, high, (batch, count, 3))),
        rotations,
        rng.uniform([-0.2, -0.2, 0.05], [0.2, 0.2, 0.4], (batch, count, 3)),
    )


def one_object(half_axes, exponents, rotation=None, position=(0, 0, 0.2)) -> SceneParameters:
    """A scene of one object."""
    rotation = np.eye(3) if rotation is None else rotation
    return parameters([[half_axes]], [[exponents]], [[rotation]], [[position]])


def dense_mesh(half_axes, exponents, side: int = 90) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a cube whose grid, denser at its edges, is scaled onto eq. 5.1."""
    a, r = np.asarray(half_axes, float), np.asarray(exponents, float)
    t = np.linspace(-1, 1, side + 1)
    t = np.sign(t) * (1 - (1 - np.abs(t)) ** 3)
    u, v = (grid.ravel() for grid in np.meshgrid(t, t, indexing="ij"))
    index = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    first, second = index[:-1, :-1].ravel(), index[1:, :-1].ravel()
    third, fourth = index[1:, 1:].ravel(), index[:-1, 1:].ravel()
    quads = np.concatenate(
        [np.stack([first, second, third], 1), np.stack([first, third, fourth], 1)]
    )
    points, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.empty((len(u), 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = sign, u, v
            faces.append((quads if sign > 0 else quads[:, ::-1]) + len(u) * len(points))
            points.append(face)
    d = np.abs(np.concatenate(points))
    low, high = np.full(len(d), -6.0), np.zeros(len(d))  # of the logarithm of the scale
    with np.errstate(divide="ignore"):
        logs = np.log(d)
    for _ in range(50):
        middle = (low + high) / 2
        outside = np.exp(r * (logs + middle[:, None])).sum(1) > 1
        high, low = np.where(outside, middle, high), np.where(outside, low, middle)
    return a * np.concatenate(points) * np.exp(low)[:, None], np.concatenate(faces)


def mesh_distances(p: SceneParameters, scene: int, points: np.ndarray) -> np.ndarray:
    """Signed distance (N, P) of points (P, 3) to each object of a scene by open3d."""
    import open3d as o3d

    distances = []
    for i in range(p.present.shape[1]):
        vertices, faces = dense_mesh(p.half_axes[scene, i], p.exponents[scene, i])
        rotation, position = p.rotations[scene, i].double().numpy(), p.positions[scene, i].numpy()
        local = ((points - position) @ rotation).astype(np.float32)
        caster = o3d.t.geometry.RaycastingScene(nthreads=2)
        caster.add_triangles(vertices.astype(np.float32), faces.astype(np.uint32))
        distances.append(caster.compute_signed_distance(local, nthreads=2).numpy())
    return np.stack(distances)
