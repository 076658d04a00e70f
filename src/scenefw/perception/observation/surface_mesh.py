"""The surface that pixels of a depth image show, as a mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scenefw.core.types import Obstacle, TriangleMesh
from scenefw.perception.observation.components import EDGE
from scenefw.perception.observation.pixels import coarse_step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64
    from scenefw.perception.observation.observation import Observation

    Mask = NDArray[np.bool_]


def obstacles_of(observations: Sequence[Observation]) -> tuple[Obstacle, ...]:
    """The obstacles of all views of a scene, one of each kind and view."""
    obstacles = []
    for view in observations:
        if view.workspace is None:
            continue
        for region in view.workspace.obstacles:
            mesh = surface_mesh(view.workspace.points, region.pixels)
            if len(mesh.faces):
                obstacles.append(Obstacle(region.kind, mesh))
    return tuple(obstacles)


def surface_mesh(points: Float64, pixels: Mask) -> TriangleMesh:
    """Two triangles between four neighbouring pixels, where the surface has no jump; open.

    Args:
        points: (H, W, 3) of the image (m), NaN = no depth.
        pixels: (H, W) that show the surface.
    """
    stride = coarse_step(points.shape[1])
    points, pixels = points[::stride, ::stride], pixels[::stride, ::stride]
    number = np.cumsum(pixels).reshape(pixels.shape) - 1
    corners = (np.s_[:-1, :-1], np.s_[1:, :-1], np.s_[1:, 1:], np.s_[:-1, 1:])
    quads = np.stack([number[corner] for corner in corners], axis=-1)
    is_whole = np.all([pixels[corner] for corner in corners], axis=0)
    sides = [points[a] - points[b] for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    longest = np.max([np.linalg.norm(side, axis=-1) for side in sides], axis=0)
    faces = quads[is_whole & (longest < stride * EDGE)]
    triangles = np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])
    used, faces_of_used = np.unique(triangles, return_inverse=True)
    return TriangleMesh(points[pixels][used], faces_of_used.reshape(-1, 3).astype(np.int64))
