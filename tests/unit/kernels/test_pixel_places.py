"""World coordinates of pixels, beside those of one frame by numpy."""

import numpy as np
import pytest
import torch

from scenefw.core.types import Frame
from scenefw.kernels.cameras import pixel_places, stack_cameras
from scenefw.perception.observation.points import world_points
from scenefw.scenes.cameras import RandomViewpoints


@pytest.mark.parametrize("size", [(16, 12), (33, 20)])
def test_they_are_those_of_each_frame(size):
    rng = np.random.default_rng(0)
    cameras = [RandomViewpoints(*size).sample(rng) for _ in range(2)]
    depth = rng.uniform(0.4, 2.0, (2, size[1], size[0])).astype(np.float32)
    found = pixel_places(torch.from_numpy(depth), stack_cameras(cameras, torch.device("cpu")))
    for image, camera, places in zip(depth, cameras, found.numpy(), strict=True):
        np.testing.assert_allclose(places, world_points(Frame(image, camera)), atol=1e-5)
