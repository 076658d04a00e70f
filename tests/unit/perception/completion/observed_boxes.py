"""Observations of two boxes on each other, whose free space is told."""

import torch
from tests.unit.perception.synthetic import camera_at, frame_of

from scenefw.core.batches import PartialTSDF
from scenefw.kernels.cameras import stack_cameras
from scenefw.perception.observation.observation import Observation

FRONT = camera_at(eye=(0.0, -0.85, 0.6))
"""The camera of `evidence.test_gathering.scene_of`."""


def partial_of(geometry, camera=FRONT):
    """The partial TSDF of an image, with the free space of a geometry."""
    free = torch.from_numpy(geometry.free)[None, None]
    distance = torch.where(free, geometry.grid.truncation, -0.01)
    depth = torch.from_numpy(frame_of(camera).depth)[None]
    return PartialTSDF(distance, free, depth, stack_cameras([camera]))


def observed(geometry, camera=FRONT):
    """The observation of this partial TSDF."""
    return Observation.of_partial(partial_of(geometry, camera), geometry.grid)
