"""Images of a tower on a floor that a stereo camera has blurred."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter, uniform_filter1d
from tests.unit.perception.synthetic import Box, camera_at, frame_of

TOWER = Box((-0.06, -0.06, 0.0), (0.06, 0.06, 0.15))


def seen(size, reach, noise=0.001, alone=0.0):
    """The true frame, and one whose windows reach so many pixels of an image 640 wide.

    Neighbours err alike by `noise`, each pixel by itself by `alone` (m).
    """
    camera = camera_at(eye=(0.0, -0.9, 0.6), size=size)
    sharp = frame_of(camera, (TOWER,))
    field = gaussian_filter(np.random.default_rng(0).normal(size=sharp.depth.shape), 4)
    depth = sharp.depth + noise * field / field.std()
    pixels = round(reach * size[0] / 640)
    for axis in (0, 1):
        depth = 1 / uniform_filter1d(1 / depth, 2 * pixels + 1, axis=axis)
    depth += alone * np.random.default_rng(1).normal(size=depth.shape)
    return sharp, replace(sharp, depth=depth.astype(np.float32), camera=camera), pixels
