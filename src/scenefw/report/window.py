"""What of a scene a picture shows: a window of the image around its objects, and colours."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scenefw.core.types import Camera, SceneEstimate
from scenefw.report.palette import Colour
from scenefw.report.shading import Picture, Solid, draw, turned

SIZE = (560, 420)
"""Width and height of pictures of objects (pixels)."""
BEHIND = 160.0
"""Degrees about the z axis to where objects are seen from behind."""


def window(estimate: SceneEstimate, aspect: float = SIZE[0] / SIZE[1]) -> tuple[slice, slice]:
    """Rows and columns of the image that show the predicted objects, with some table around.

    Args:
        estimate: its objects are projected into the camera.
        aspect: width by height.
    """
    camera = estimate.frame.camera
    height, width = camera.height, camera.width
    pixels = _project(vertices(estimate), camera)
    if len(pixels) == 0:  # the middle of the image
        wide = min(width, height * aspect)
        top, left = int(height - wide / aspect) // 2, int(width - wide) // 2
        return slice(top, top + round(wide / aspect)), slice(left, left + round(wide))
    low, high = np.clip(pixels.min(axis=0), 0, None), pixels.max(axis=0)
    high = np.minimum(high, (width - 1, height - 1))
    middle, size = (low + high) / 2, (high - low) * 1.5
    wide = min(max(size[0], size[1] * aspect, 0.4 * width), width, height * aspect)
    tall = wide / aspect
    left = int(np.clip(middle[0] - wide / 2, 0, width - wide))
    top = int(np.clip(middle[1] - tall / 2, 0, height - tall))
    return slice(top, top + round(tall)), slice(left, left + round(wide))


def vertices(estimate: SceneEstimate) -> NDArray[np.float64]:
    """All vertices (N, 3) of the objects, world coordinates."""
    if not estimate.objects:
        return np.zeros((0, 3))
    return np.concatenate([item.mesh.vertices for item in estimate.objects])


def _project(points: NDArray[np.float64], camera: Camera) -> NDArray[np.float64]:
    """Pixels (N, 2) of the points before the camera."""
    pose = camera.T_world_camera
    local = (points - pose[:3, 3]) @ pose[:3, :3]
    local = local[local[:, 2] > 0.05]
    return local[:, :2] / local[:, 2:] * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def cropped(camera: Camera, rows: slice, columns: slice) -> Camera:
    """The camera of a window of its image, resampled to the size of drawn pictures.

    Args:
        camera: of the whole image.
        rows: of the window, as `window` gives them.
        columns: of the window.
    """
    part = Camera(
        columns.stop - columns.start,
        rows.stop - rows.start,
        camera.fx,
        camera.fy,
        camera.cx - columns.start,
        camera.cy - rows.start,
        camera.T_world_camera,
    )
    return part.resized(*SIZE)


def two_views(solid: Solid, estimate: SceneEstimate) -> tuple[Picture, Picture]:
    """Pictures of the objects from the camera, and from behind.

    Args:
        solid: the scene made ready for drawing.
        estimate: the scene.
    """
    camera = cropped(estimate.frame.camera, *window(estimate))
    behind = turned(camera, vertices(estimate), BEHIND)
    return draw(solid, camera), draw(solid, behind)


def by_label(estimate: SceneEstimate, colours: Sequence[Colour]) -> list[Colour]:
    """Colours by instance label - 1; labels without an object are grey."""
    table = [(0.6, 0.6, 0.6)] * max([item.id for item in estimate.objects], default=0)
    for item, colour in zip(estimate.objects, colours, strict=True):
        table[item.id - 1] = colour
    return table
