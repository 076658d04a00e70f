"""The geometry channel of a labelling network: depth, or height above the table."""

import numpy as np
from numpy.typing import NDArray

from scenefw.core.errors import ConfigError
from scenefw.core.types import Frame

DEPTH, HEIGHT = "depth", "height"


def distance_image(
    frame: Frame, geometry: str = DEPTH, depth: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """(H, W) float32 metres, NaN where nothing was measured.

    Args:
        frame: the view; heights need its pose in the table's frame.
        geometry: depth along the optical axis (as in the thesis), or height above the table, which
            the pose makes of it (one of the channels of HHA, Gupta et al. 2014).
        depth: instead of the frame's.

    Raises:
        ConfigError: another geometry.
    """
    z = frame.depth if depth is None else depth
    if geometry == DEPTH:
        found = z
    elif geometry == HEIGHT:
        found = _heights(frame, z)
    else:
        raise ConfigError(f"geometry = {geometry!r}; expected {DEPTH} or {HEIGHT}")
    return np.where(z > 0, found, np.nan).astype(np.float32)


def _heights(frame: Frame, z: NDArray[np.float32]) -> NDArray[np.float32]:
    camera = frame.camera
    x = (np.arange(camera.width, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    y = (np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    right, down, ahead, above = camera.T_world_camera[2].astype(np.float32)
    heights: NDArray[np.float32] = z * (right * x + down * y[:, None] + ahead) + above
    return heights
