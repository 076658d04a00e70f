"""Few points whose convex hull, grown by a collision margin, is the shape itself."""

from functools import lru_cache, singledispatch

import numpy as np
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from scenefw.core.types import Shape, TriangleMesh
from scenefw.shapes.solid_mesh import SolidMesh
from scenefw.shapes.superquadric import Array, Superquadric


def collision_hulls(shape: Shape, tolerance: float, margin: float) -> list[Array]:
    """Points (K, 3) of the convex parts that a shape collides as, as of `collision_hull`."""
    if not isinstance(shape, SolidMesh):
        return [collision_hull(shape, tolerance, margin)]
    return _mesh_hulls(shape, tolerance, margin)


@lru_cache(maxsize=256)  # by identity; a folder's meshes come back in every scene
def _mesh_hulls(shape: SolidMesh, tolerance: float, margin: float) -> list[Array]:
    return [_drawn_in(part, tolerance, margin) for part in shape.parts or (shape.vertices,)]


@singledispatch
def collision_hull(shape: Shape, tolerance: float, margin: float) -> Array:
    """Points (K, 3) whose hull, rounded by a ball of radius `margin`, fits the shape's convex hull.

    Args:
        shape: any shape; of a mesh the convex hull counts.
        tolerance: width of the band that the fitted surface keeps to, half on either side (m).
        margin: the collision margin that the engine adds all around (m).
    """
    planes = ConvexHull(shape.mesh().vertices).equations
    planes[:, 3] += margin
    corners = HalfspaceIntersection(np.unique(planes.round(9), axis=0), np.zeros(3)).intersections
    return corners[ConvexHull(corners).vertices]


@collision_hull.register
def _(shape: Superquadric, tolerance: float, margin: float) -> Array:
    return _superquadric_hull(
        tuple(shape.half_axes.tolist()), tuple(shape.exponents.tolist()), tolerance, margin
    )


@lru_cache(maxsize=8192)  # a library's shapes come back in every scene
def _superquadric_hull(
    half_axes: tuple[float, ...], exponents: tuple[float, ...], tolerance: float, margin: float
) -> Array:
    shape = Superquadric(np.array(half_axes), np.array(exponents))
    directions = _directions(shape)
    points = shape.support(directions)
    corners = points[covering(directions, points, tolerance)]
    # A chord lies up to `tolerance` inside a curved surface: moving the corners out by half of
    # that centres the error. Flat sides lie exactly at the half-axes and stay there.
    inset = corners - (margin - tolerance / 2) * shape.normals(corners)
    limit = np.maximum(shape.half_axes - margin, shape.half_axes / 2)
    return np.asarray(np.round(np.clip(inset, -limit, limit), 8), dtype=np.float64)


def _drawn_in(points: Array, tolerance: float, margin: float) -> Array:
    """Few points whose hull, rounded by the margin, follows that of the points within a tolerance.

    Parts that are no thicker than two margins are drawn in by less; flat ones stay as they are.
    """
    try:
        hull = ConvexHull(points)
        axes = np.concatenate([np.eye(3), -np.eye(3)])
        directions = np.concatenate([axes, sphere_points(500), hull.equations[:, :3]])
        corners = points[hull.vertices]
        tips = corners[(directions @ corners.T).argmax(axis=1)]
        vertices = np.unique(tips[covering(directions, tips, tolerance)], axis=0)
        planes = np.unique(ConvexHull(vertices).equations.round(9), axis=0)
        centre, depth = _deepest(planes)
        planes[:, 3] += min(margin, depth / 2)
        inner = HalfspaceIntersection(planes, centre).intersections
        return np.asarray(inner[ConvexHull(inner).vertices])
    except QhullError:
        return np.asarray(points)


def _deepest(planes: Array) -> tuple[Array, float]:
    """Centre (3,) and radius of the largest ball inside planes (P, 4)."""
    solution = linprog(
        [0, 0, 0, -1],
        A_ub=np.column_stack([planes[:, :3], np.ones(len(planes))]),
        b_ub=-planes[:, 3],
        bounds=[(None, None)] * 3 + [(0, None)],
    )
    return solution.x[:3], float(solution.x[3])


def _directions(shape: Superquadric) -> Array:
    """Unit normals (K, 3), dense both on the sphere of directions and on the surface."""
    on_sphere = sphere_points(1500)
    on_surface = shape.normals(shape.project(sphere_points(1500) * shape.half_axes))
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    return np.concatenate([axes, on_sphere, on_surface])


def covering(directions: Array, points: Array, tolerance: float) -> list[int]:
    """Indices of support points whose hull comes within `tolerance` of all of them, greedily."""
    reach = np.einsum("ij,ij->i", directions, points)
    indices = list(range(6))
    covered = (directions @ points[:6].T).max(axis=1)
    while True:
        gaps = np.round(reach - covered, 9)  # the last bits differ between processors
        worst = int(np.argmax(gaps))
        if gaps[worst] <= tolerance:
            return indices
        indices.append(worst)
        np.maximum(covered, directions @ points[worst], out=covered)


def hull_mesh(points: Array) -> TriangleMesh:
    """The convex hull of points (N, 3), closed, its faces counter-clockwise from outside."""
    hull = ConvexHull(points)
    indices = np.sort(hull.vertices)
    vertices, faces = points[indices], np.searchsorted(indices, hull.simplices)
    a, b, c = np.moveaxis(vertices.take(faces, axis=0), 1, 0)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) > 0
    faces = np.where(outward[:, None], faces, faces[:, ::-1])
    return TriangleMesh(vertices, faces.astype(np.int64))


def sphere_points(count: int) -> Array:
    """Nearly even points (count, 3) on the unit sphere."""
    z = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
