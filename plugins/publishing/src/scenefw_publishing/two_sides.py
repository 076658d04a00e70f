"""Predicted objects from two sides, without the image: a picture for documents."""

import numpy as np
from scipy import ndimage

from scenefw.core.geometry import inverse, transform_points
from scenefw.core.types import Camera, Float32, SceneEstimate
from scenefw.report.palette import instance_colours
from scenefw.report.shading import Picture, draw, turned
from scenefw.report.solids import of_objects, solid_of
from scenefw.report.surfaces import Surfaces
from scenefw.report.window import by_label, cropped, vertices, window

_SIZE = (440, 330)  # of a side: width, height (pixels)
_GAP = 8  # pixels
_TURN = 150.0  # degrees
_BEHIND = 1.5  # voxels from a seen surface to a hidden one behind it


def draw_two_sides(estimate: SceneEstimate) -> Picture:
    """RGB (H, W, 3) in [0, 1]: from the camera, and from behind.

    Every object has its colour; what is hidden from the camera is pale.
    """
    colours = by_label(estimate, instance_colours(len(estimate.objects)))
    camera = cropped(estimate.frame.camera, *window(estimate)).resized(*_SIZE)
    surfaces = Surfaces({item.id: item.mesh for item in estimate.objects})
    visibility = seen_share(estimate, of_objects(estimate), surfaces, camera)
    solid = solid_of(estimate, colours, visibility)
    tiles = [draw(solid, camera), draw(solid, turned(camera, vertices(estimate), _TURN))]
    gap = np.ones((tiles[0].shape[0], _GAP, 3), dtype=np.float32)
    return np.concatenate([tiles[0], gap, tiles[1]], axis=1)


def seen_share(
    estimate: SceneEstimate, tsdf: Float32, surfaces: Surfaces, camera: Camera
) -> Float32:
    """How much of the surface around each voxel no other surface hides, (X, Y, Z) in [0, 1].

    Args:
        estimate: gives the grid.
        tsdf: (X, Y, Z) with the surface (m).
        surfaces: that hide what lies behind.
        camera: from where.
    """
    grid = estimate.grid
    surface = np.abs(tsdf) < 1.5 * grid.voxel_size
    depth = surfaces.seen_from(camera)[0]
    points = transform_points(inverse(camera.T_world_camera), grid.centres()[surface])
    z = np.maximum(points[:, 2], 1e-6)
    u = np.rint(points[:, 0] / z * camera.fx + camera.cx).astype(int)
    v = np.rint(points[:, 1] / z * camera.fy + camera.cy).astype(int)
    inside = (points[:, 2] > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    hit = np.where(inside, depth[np.where(inside, v, 0), np.where(inside, u, 0)], np.inf)
    marks = np.zeros((2, *surface.shape), dtype=np.float32)
    marks[0, surface], marks[1] = (hit == 0) | (z < hit + _BEHIND * grid.voxel_size), surface
    visible, total = (ndimage.gaussian_filter(mark, 1.0) for mark in marks)
    return (visible / np.maximum(total, 1e-6)).astype(np.float32)
