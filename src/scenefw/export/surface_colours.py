"""Colours of an image on the surfaces that it shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.weak_cache import cached_by_identity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from scenefw.core.types import Float64, SceneEstimate, TriangleMesh
    from scenefw.export.meshes import Colour


def surface_colours(
    estimate: SceneEstimate, colours: Sequence[Colour]
) -> list[Colour | NDArray[np.float64]]:
    """The colours of each object's vertices (V, 3) in [0, 1], sRGB, where the image has colour.

    A vertex that faces the camera has the colour of its pixel, if that shows the object; any other
    that of the nearest such vertex of its object. An object without one keeps its own colour.

    Args:
        estimate: objects and camera in one frame.
        colours: of the objects where the image says nothing, in their order.
    """
    paints = zip(_paints(estimate), colours, strict=True)
    return [colour if paint is None else paint for paint, colour in paints]


@cached_by_identity
def _paints(estimate: SceneEstimate) -> list[NDArray[np.float64] | None]:
    """Computed once: several files of a scene hold them."""
    if estimate.frame.colour is None or estimate.masks is None:
        return [None] * len(estimate.objects)
    return [_painted(item.mesh, estimate.masks == item.id, estimate) for item in estimate.objects]


def _painted(
    mesh: TriangleMesh, mask: NDArray[np.bool_], estimate: SceneEstimate
) -> NDArray[np.float64] | None:
    camera, image = estimate.frame.camera, estimate.frame.colour
    points = transform_points(inverse(camera.T_world_camera), mesh.vertices)
    facing = (_normals(points, mesh.faces) * points).sum(axis=1) < 0
    depth = np.where(points[:, 2] > 0, points[:, 2], np.inf)
    columns = np.rint(camera.fx * points[:, 0] / depth + camera.cx).astype(np.int64)
    rows = np.rint(camera.fy * points[:, 1] / depth + camera.cy).astype(np.int64)
    inside = (rows >= 0) & (rows < camera.height) & (columns >= 0) & (columns < camera.width)
    inside &= facing & np.isfinite(depth)
    inside[inside] = mask[rows[inside], columns[inside]]
    visible, hidden = np.flatnonzero(inside), np.flatnonzero(~inside)
    if image is None or not len(visible):
        return None
    nearest = np.arange(len(points))
    nearest[hidden] = visible[cKDTree(points[visible]).query(points[hidden])[1]]
    return np.asarray(image[rows[nearest], columns[nearest]] / 255.0)


def _normals(vertices: Float64, faces: NDArray[np.int64]) -> Float64:
    """Directions (V, 3) in which a closed surface looks at its vertices; lengths mean nothing."""
    corners = vertices[faces]
    directions = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    weights, owners = np.repeat(directions, 3, axis=0), faces.ravel()
    return np.column_stack([np.bincount(owners, w, len(vertices)) for w in weights.T])
