"""Checks of finished scenes that use no simulator: how deep superquadrics cut into each other."""

from itertools import combinations

import numpy as np
from scipy.optimize import minimize

from scenefw.core.types import Scene, SceneObject
from scenefw.shapes.hulls import sphere_points
from scenefw.shapes.superquadric import Array, Superquadric


def deepest_penetration(scene: Scene, directions: int = 2000) -> float:
    """Largest depth (m) by which two superquadrics, or one and the floor, cut into each other.

    Negative when nothing touches: then minus the narrowest gap. For convex bodies the depth is the
    smallest move that parts them: the minimum over directions of the overlap of their shadows
    (support functions), found by a local search from the best of `directions`.
    """
    depths = [-_lowest(item) for item in scene.objects]
    depths += [_overlap(a, b, directions) for a, b in combinations(scene.objects, 2)]
    return max(depths, default=-np.inf)


def _lowest(item: SceneObject) -> float:
    """Height of the object's lowest point over the floor (m)."""
    return float(item.pose.position[2] - _reach(item, np.array([[0.0, 0.0, -1.0]]))[0])


def _overlap(a: SceneObject, b: SceneObject, directions: int) -> float:
    between = b.pose.position - a.pose.position

    def shadow(normals: Array) -> Array:
        return _reach(a, normals) + _reach(b, -normals) - normals @ between

    faces = np.concatenate([a.pose.rotation.T, b.pose.rotation.T])
    normals = np.concatenate([sphere_points(directions), faces, -faces])
    values = shadow(normals)
    best = normals[np.argmin(values)]
    # The minimum has kinks for box-like shapes, so the search uses no derivatives.
    found = minimize(
        lambda n: float(shadow((n / np.linalg.norm(n))[None])[0]),
        best,
        method="Nelder-Mead",
        options={"xatol": 1e-5, "fatol": 1e-7, "initial_simplex": best + 0.02 * np.eye(4, 3)},
    )
    return min(float(values.min()), float(found.fun))


def _reach(item: SceneObject, normals: Array) -> Array:
    """Support function of the object about its centre: extent (K,) along unit normals (K, 3)."""
    shape = item.shape
    if not isinstance(shape, Superquadric):
        raise TypeError(f"{type(shape).__name__} has no support function; expected a Superquadric")
    local = normals @ item.pose.rotation
    return np.einsum("ij,ij->i", local, shape.support(local))
