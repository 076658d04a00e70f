"""Depth at which rays through pixels enter and leave a closed mesh, drawn triangle by triangle."""

# Types are inferred at compilation, and numba ignores annotations.
# ruff: noqa: ANN001, ANN201

from __future__ import annotations

import numpy as np
from numba import njit

from scenefw.kernels.compile import declare

_NEAR = 1e-6  # m before the camera: what is nearer isn't drawn


@njit(cache=True, nogil=True)
def draw(vertices, faces, focal, centre, step, first, front, back):
    """Draws `front` and `back` (h, w), which are infinite before, in every `step`-th pixel.

    A ray d through triangle (a, b, c) meets it where d (b x c), d (c x a), d (a x b) have one sign,
    at depth a (b x c) / their sum, and leaves the solid where the sum is positive: it is d times
    the normal. Neighbours share the products of their edge, so no ray slips between them.

    Args:
        vertices: (V, 3) in the camera's frame (m).
        faces: (F, 3), counter-clockwise from outside.
        focal: lengths (2,) in pixels.
        centre: (2,) column and row.
        step: of pixels.
        first: (2,) number of the first row and column, in steps.
        front: least depth at which a ray meets the mesh (m).
        back: least depth at which one leaves it (m).
    """
    height, width = front.shape
    columns, rows = np.empty(len(vertices)), np.empty(len(vertices))
    for k in range(len(vertices)):
        z = max(vertices[k, 2], _NEAR)
        columns[k] = (focal[0] * vertices[k, 0] / z + centre[0]) / step - first[1]
        rows[k] = (focal[1] * vertices[k, 1] / z + centre[1]) / step - first[0]
    for k in range(len(faces)):
        i, j, m = faces[k, 0], faces[k, 1], faces[k, 2]
        ax, ay, az = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        bx, by, bz = vertices[j, 0], vertices[j, 1], vertices[j, 2]
        cx, cy, cz = vertices[m, 0], vertices[m, 1], vertices[m, 2]
        if min(az, bz, cz) < _NEAR:
            continue
        first_row = max(int(np.ceil(min(rows[i], rows[j], rows[m]))), 0)
        last_row = min(int(np.floor(max(rows[i], rows[j], rows[m]))), height - 1)
        first_column = max(int(np.ceil(min(columns[i], columns[j], columns[m]))), 0)
        last_column = min(int(np.floor(max(columns[i], columns[j], columns[m]))), width - 1)
        if first_row > last_row or first_column > last_column:
            continue
        px, py, pz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        qx, qy, qz = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        rx, ry, rz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        volume = ax * px + ay * py + az * pz
        for row in range(first_row, last_row + 1):
            y = ((row + first[0]) * step - centre[1]) / focal[1]
            for column in range(first_column, last_column + 1):
                x = ((column + first[1]) * step - centre[0]) / focal[0]
                p = x * px + y * py + pz
                q = x * qx + y * qy + qz
                r = x * rx + y * ry + rz
                total = p + q + r
                if total > 0:
                    if min(p, q, r) < 0:
                        continue
                elif total < 0:
                    if max(p, q, r) > 0:
                        continue
                else:
                    continue
                depth = volume / total
                front[row, column] = min(front[row, column], depth)
                if total > 0:
                    back[row, column] = min(back[row, column], depth)


declare(draw, "f8[:, ::1], i8[:, ::1], f8[::1], f8[::1], i8, i8[::1], f8[:, ::1], f8[:, ::1]")
