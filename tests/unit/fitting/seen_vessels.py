"""Points that a camera sees of upright vessels, by rays through their meshes."""

import numpy as np
import torch

from scenefw.kernels.meshes import Tree

EYE = np.array([0.1, -0.7, 0.55])


def seen(mesh, place=(0.0, 0.0), eye=EYE, count=4000, seed=0):
    """Points (N, 3) of a mesh whose lowest corner is put onto the floor."""
    rng = np.random.default_rng(seed)
    corners = mesh.vertices + [*place, -mesh.vertices[:, 2].min()]
    targets = rng.uniform(corners.min(axis=0), corners.max(axis=0), (count, 3))
    rays = np.concatenate([np.broadcast_to(eye, targets.shape), targets - eye], axis=1)
    tree = Tree(corners[mesh.faces].astype(np.float32))
    far, hit, _ = tree.cast(torch.from_numpy(rays.astype(np.float32)), table=False)
    far, hit = far.numpy().astype(float), hit.numpy()
    return (eye + far[:, None] * (targets - eye))[hit >= 0]
