"""Normals at the corners of triangles, as means over those that meet smoothly there."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN202

import numpy as np
from numba import njit
from numpy.typing import NDArray

from scenefw.kernels.compile import declare

_TINY = 1e-15


def corner_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], smooth: float
) -> NDArray[np.float64]:
    """Normals (F, 3, 3) of the corners of faces, weighted by areas.

    Args:
        vertices: (V, 3) metres.
        faces: (F, 3) indices of vertices.
        smooth: faces are meant together whose normals' cosine at a shared vertex is larger.
    """
    corners = vertices[faces]
    crossed = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.sqrt(np.einsum("nk,nk->n", crossed, crossed))
    normals = crossed / np.maximum(lengths, _TINY)[:, None]
    return _means(np.ascontiguousarray(faces), len(vertices), crossed, normals, smooth)


@njit(cache=True)
def _means(faces, vertices, crossed, normals, smooth):
    count = len(faces)
    # Corners, as 3 times the face plus 0 to 2, in the order of their vertices
    starts = np.zeros(vertices + 1, dtype=np.int64)
    for face in range(count):
        for k in range(3):
            starts[faces[face, k] + 1] += 1
    for vertex in range(vertices):
        starts[vertex + 1] += starts[vertex]
    order, filled = np.empty(3 * count, dtype=np.int64), np.zeros(vertices, dtype=np.int64)
    for face in range(count):
        for k in range(3):
            vertex = faces[face, k]
            order[starts[vertex] + filled[vertex]] = face
            filled[vertex] += 1
    means = np.empty((count, 3, 3))
    for face in range(count):
        a, b, c = normals[face, 0], normals[face, 1], normals[face, 2]
        for k in range(3):
            x, y, z = 0.0, 0.0, 0.0
            vertex = faces[face, k]
            for at in range(starts[vertex], starts[vertex + 1]):
                neighbour = order[at]
                if (
                    a * normals[neighbour, 0]
                    + b * normals[neighbour, 1]
                    + c * normals[neighbour, 2]
                    > smooth
                ):
                    x += crossed[neighbour, 0]
                    y += crossed[neighbour, 1]
                    z += crossed[neighbour, 2]
            length = np.sqrt(x * x + y * y + z * z)
            if length <= _TINY:
                x, y, z, length = a, b, c, 1.0
            means[face, k, 0], means[face, k, 1], means[face, k, 2] = (
                x / length,
                y / length,
                z / length,
            )
    return means


declare(_means, "i8[:, ::1], i8, f8[:, ::1], f8[:, ::1], f8")
