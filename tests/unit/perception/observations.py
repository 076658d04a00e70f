"""Observations of frames whose cameras have their poses."""

import torch

from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.projective import Projective
from scenefw.perception.observation.observation import Observation


def observation_of(frame, grid, masks=None):
    """The observation of a frame, fused; `masks` (H, W) are marked objects."""
    depth = torch.from_numpy(frame.depth)[None]
    partial = Projective().fuse(depth, grid, stack_cameras([frame.camera]))
    return Observation(frame, partial, grid, masks)
