"""Instances as connected parts of the inside: the trivial reference to Hough voting."""

import numpy as np
import torch
from scipy import ndimage
from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.types import GridSpec


class ConnectedComponents:
    """Labels parts of tsdf < 0 that share voxel faces; objects that touch become one instance.

    Args:
        smallest: parts below this volume are no instances (m^3).
    """

    def __init__(self, smallest: float = 3e-5) -> None:
        self.smallest = smallest

    def extract(self, tsdf: Tensor, votes: Tensor, grid: GridSpec) -> tuple[Tensor, Tensor]:
        """Instances (X, Y, Z) int32, 1..N by size, and their centroids (N, 3) metres."""
        if tuple(tsdf.shape) != grid.shape:
            raise InputError(
                f"tsdf has shape {tuple(tsdf.shape)}, expected {grid.shape}; give one scene "
                "without its batch dimension"
            )
        parts, count = ndimage.label(tsdf.cpu().numpy() < 0)
        sizes = np.bincount(parts.ravel(), minlength=count + 1)[1:]
        order = np.argsort(-sizes, kind="stable")
        order = order[sizes[order] * grid.voxel_size**3 >= self.smallest]
        labels = np.zeros(count + 1, dtype=np.int32)
        labels[order + 1] = np.arange(1, len(order) + 1)
        centres = np.zeros((0, 3))
        if len(order):
            voxels = ndimage.center_of_mass(parts > 0, parts, order + 1)
            centres = grid.to_world(np.asarray(voxels))
        return (
            torch.from_numpy(labels[parts]).to(tsdf.device),
            torch.from_numpy(centres).float().to(tsdf.device),
        )
