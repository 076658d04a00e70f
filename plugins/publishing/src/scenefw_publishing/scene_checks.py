"""Checks of finished scenes that use no simulator: how deeply superquadrics intersect."""

from itertools import combinations

import numpy as np

from scenefw.core.types import Scene, SceneObject
from scenefw.shapes.hulls import sphere_points
from scenefw.shapes.superquadric import Array, Superquadric


def deepest_penetration(scene: Scene, directions: int = 1000) -> float:
    """Largest penetration depth (m) of two superquadrics, or of one and the floor.

    For convex bodies the depth is the smallest move that parts them: the minimum over directions of
    the overlap of their shadows (support functions), found by a local search from the best of
    `directions`. Negative when nothing touches: then minus a lower bound of the narrowest gap.
    """
    depths = [-_lowest(item) for item in scene.objects]
    depths += [_overlap(a, b, directions) for a, b in combinations(scene.objects, 2)]
    return max(depths, default=-np.inf)


def _lowest(item: SceneObject) -> float:
    """Height of the object's lowest point over the floor (m)."""
    return float(item.pose.position[2] - _reach(item, np.array([[0.0, 0.0, -1.0]]))[0])


def _overlap(a: SceneObject, b: SceneObject, directions: int) -> float:
    between = b.pose.position - a.pose.position
    gap = np.linalg.norm(between) - _radius(a) - _radius(b)
    if gap > 0:
        return -float(gap)

    def shadow(normals: Array) -> Array:
        return _reach(a, normals) + _reach(b, -normals) - normals @ between

    faces = np.concatenate([a.pose.rotation.T, b.pose.rotation.T])
    normals = np.concatenate([sphere_points(directions), faces, -faces])
    best = normals[np.argmin(shadow(normals))]
    # The minimum has kinks for box-like shapes, so the search uses no derivatives: it looks around
    # the best so far in ever smaller circles.
    around = sphere_points(100)
    for radius in 0.1 * 0.4 ** np.arange(10):
        normals = np.concatenate([best[None], best + radius * around])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        values = shadow(normals)
        best = normals[np.argmin(values)]
    return float(values.min())


def _radius(item: SceneObject) -> float:
    """Radius of a ball about the object's centre that holds it (m)."""
    shape = item.shape
    return float(np.linalg.norm(shape.half_axes)) if isinstance(shape, Superquadric) else np.inf


def _reach(item: SceneObject, normals: Array) -> Array:
    """Support function of the object about its centre: extent (K,) along unit normals (K, 3)."""
    shape = item.shape
    if not isinstance(shape, Superquadric):
        raise TypeError(f"{type(shape).__name__} has no support function; expected a Superquadric")
    local = normals @ item.pose.rotation
    return np.einsum("ij,ij->i", local, shape.support(local))
