"""Errors of a floor that is found in an image."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ndtri

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.rng import Streams


def floor_motions(streams: Streams, tilt: float, lift: float) -> NDArray[np.float32]:
    """Motions (B, 4, 4) of the world by which a floor is found wrongly.

    Args:
        streams: of the images.
        tilt: standard deviation of its slope (degrees), along x and y each.
        lift: the same of its height (m).
    """
    normal = ndtri(streams.uniform(3))
    slopes = np.radians(tilt) * normal[:, :2]
    motions = np.tile(np.eye(4), (len(streams), 1, 1))
    motions[:, :3, :3] = Rotation.from_rotvec(np.pad(slopes, ((0, 0), (0, 1)))).as_matrix()
    motions[:, 2, 3] = lift * normal[:, 2]
    return motions.astype(np.float32)
