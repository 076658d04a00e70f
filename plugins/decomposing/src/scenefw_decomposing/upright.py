"""Which way is up in the mesh of a scene: its table says so."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from scenefw.core.types import Float64, TriangleMesh
from scenefw.perception.observation.points import DRAWS, MAJORITY, MIN_PARALLEL_COSINE, MINORITY

_POINTS = 20000
_NEAR_AXIS = 10.0  # degrees: nearer, an axis of the file is meant
HALF_THICKNESS = 0.01
"""m: what is as near to the plane of a scanned table is the table."""
MAX_HEIGHT = 1.0
"""m above a table, of what belongs to its scene."""


def table_normal(mesh: TriangleMesh) -> Float64 | None:
    """The direction (3,) in which the table of a scene faces; None if there is no table.

    A table is the largest plane over which most of the rest lies. Of several, one that faces z is
    preferred, since walls can be larger than tables.

    Args:
        mesh: with triangles that face outward.
    """
    import trimesh

    surface = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    points, faces = trimesh.sample.sample_surface(surface, _POINTS, seed=0)
    points, normals = np.asarray(points), np.asarray(surface.face_normals)[faces]
    best, best_key = None, (False, 0)
    for number in np.linspace(0, len(points) - 1, DRAWS).astype(int):
        plane = _plane(points, normals, normals[number])
        if plane is None:
            continue
        normal, size = plane
        key = (_faces_z(normal), size)
        if key > best_key:
            best, best_key = normal, key
    return best


def turned_upright(mesh: TriangleMesh) -> tuple[Float64, str]:
    """The rotation (3, 3) that turns the table of a mesh up, and what was done, in words.

    A table that is not far from z is left as it is; so is a mesh without one.
    """
    normal = table_normal(mesh)
    if normal is None or _faces_z(normal):
        return np.eye(3), ""
    axis = int(np.abs(normal).argmax())
    direction = np.sign(normal[axis]) * np.eye(3)[axis]
    words = f"{'-' if normal[axis] < 0 else '+'}{'xyz'[axis]}"
    if normal @ direction < np.cos(np.radians(_NEAR_AXIS)):
        direction = normal
        words = "(" + ", ".join(f"{value:.2f}" for value in normal) + ")"
    return _to_z(direction), f"the table faces {words} of the file, so the mesh was turned z up"


def _faces_z(direction: Float64) -> bool:
    """Whether a direction is nearer to z than to any other axis of the file."""
    return bool(direction[2] >= np.abs(direction).max())


def _to_z(direction: Float64) -> Float64:
    """The shortest rotation (3, 3) of a direction to z; half a turn about x from -z."""
    axis = np.cross(direction, (0.0, 0.0, 1.0))
    sine = float(np.linalg.norm(axis))
    axis = axis / sine if sine > 1e-9 else np.array([1.0, 0.0, 0.0])
    return np.asarray(Rotation.from_rotvec(np.arctan2(sine, direction[2]) * axis).as_matrix())


def _plane(points: Float64, normals: Float64, direction: Float64) -> tuple[Float64, int] | None:
    """Normal and number of points of the largest plane that faces a direction, if it is a table."""
    facing = normals @ direction > MIN_PARALLEL_COSINE
    normal = normals[facing].mean(axis=0)
    normal /= np.linalg.norm(normal)
    heights = points @ normal
    steps = np.rint(heights[facing] / (2 * HALF_THICKNESS)).astype(np.int64)
    values, counts = np.unique(steps, return_counts=True)
    level = np.median(heights[facing][steps == values[counts.argmax()]])
    heights = heights - level
    on_plane = facing & (np.abs(heights) < HALF_THICKNESS)
    above = (heights > HALF_THICKNESS) & (heights < MAX_HEIGHT)
    if not above.any():
        return None
    across = np.linalg.svd(normal[None])[2][1:]  # (2, 3) along the plane
    try:
        edges = ConvexHull(points[on_plane] @ across.T).equations
    except QhullError:  # too few points, or in a line
        return None
    outside = points[above] @ across.T @ edges[:, :2].T + edges[:, 2] > 0
    coverage = np.mean(~outside.any(axis=1))
    # Things stand on a table, but not on the side of a box, beyond which most of the scene lies. A
    # mesh without a table may have such a side that covers most others, but hardly nearly all
    min_coverage = MAJORITY if _faces_z(normal) else 1 - MINORITY
    return (normal, int(on_plane.sum())) if coverage > min_coverage else None
