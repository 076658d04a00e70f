"""Stacks of boxes as estimates, and how far simulated objects have moved."""

import numpy as np
import trimesh

from scenefw.core.geometry import rotation_from_quaternion
from scenefw.core.types import Camera, Frame, GridSpec, SceneEstimate, TriangleMesh
from scenefw.perception.estimate.objects import estimate_objects

SIZES = ((0.20, 0.16, 0.10), (0.12, 0.14, 0.06), (0.08, 0.06, 0.09))
COLOURS = [(0.0, 0.4, 0.7), (0.9, 0.6, 0.0), (0.0, 0.6, 0.5)]


def stack(shift=0.0, turn=0.3):
    """Three boxes on each other, each turned; the uppermost moved sideways by `shift`."""
    meshes, height = {}, 0.0
    for i, size in enumerate(SIZES):
        box = trimesh.creation.box(size)
        place = trimesh.transformations.rotation_matrix(turn * i, (0, 0, 1))
        place[:3, 3] = (0.1 + shift * (i == 2), -0.05, height + size[2] / 2)
        box.apply_transform(place)
        meshes[i + 1] = TriangleMesh(np.array(box.vertices), np.array(box.faces))
        height += size[2]
    grid = GridSpec(resolution=8)
    frame = Frame(np.ones((4, 5), np.float32), Camera(width=5, height=4), name="boxes")
    volume = np.zeros(grid.shape)
    objects = estimate_objects(meshes, {})
    return SceneEstimate(
        objects, grid, volume.astype(np.float32), volume.astype(np.int32), frame, {}
    )


def moved(before, after):
    """The largest way (m) and angle (degrees) of poses (position, quaternion w x y z)."""
    ways, angles = [], []
    for (p, q), (r, s) in zip(before, after, strict=True):
        ways.append(np.linalg.norm(np.subtract(p, r)))
        turn = rotation_from_quaternion(np.array(q)).T @ rotation_from_quaternion(np.array(s))
        angles.append(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1))))
    return max(ways), max(angles)
