"""Analytic scenes of touching spheres and boxes with exact votes, made here from scratch."""

import numpy as np
import torch

from scenefw.core.types import GridSpec


def sphere(centre, radius):
    return lambda p: np.linalg.norm(p - centre, axis=-1) - radius


def box(centre, half):
    def distance(p):
        q = np.abs(p - centre) - half
        return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)

    return distance


def touching():
    """A ball and a small box on a wide box, a tall box beside them: all touch."""
    centres = np.array([[0, 0, 0.05], [-0.06, 0, 0.17], [0.09, 0.02, 0.14], [0.21, 0, 0.15]])
    parts = [
        box(centres[0], np.array([0.15, 0.1, 0.05])),
        sphere(centres[1], 0.07),
        box(centres[2], np.array([0.05, 0.05, 0.04])),
        box(centres[3], np.array([0.06, 0.08, 0.15])),
    ]
    return parts, centres


def volumes(parts, centres, grid: GridSpec):
    """TSDF (X, Y, Z), votes (3, X, Y, Z) and labels (X, Y, Z) as tensors."""
    points = grid.centres()
    fields = np.stack([part(points) for part in parts])
    tsdf = fields.min(axis=0).clip(-grid.truncation, grid.truncation)
    labels = np.where(tsdf < 0, fields.argmin(axis=0) + 1, 0).astype(np.int32)
    towards = np.asarray(centres)[np.maximum(labels, 1) - 1] - points
    lengths = np.linalg.norm(towards, axis=-1, keepdims=True)
    votes = np.where((labels > 0)[..., None], towards / np.maximum(lengths, 1e-9), 0.0)
    return (
        torch.tensor(tsdf, dtype=torch.float32),
        torch.tensor(np.moveaxis(votes, -1, 0).copy(), dtype=torch.float32),
        torch.from_numpy(labels),
    )


def ious(predicted, true):
    """By brute force: best IoU with any instance, for each true object."""
    predicted, true = predicted.numpy(), true.numpy()
    best = []
    for i in np.unique(true[true > 0]):
        found = [
            np.sum((predicted == j) & (true == i)) / np.sum((predicted == j) | (true == i))
            for j in np.unique(predicted[predicted > 0])
        ]
        best.append(max(found, default=0.0))
    return np.array(best)
