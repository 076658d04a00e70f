"""Brings a depth image into the frame of its floor, and checks it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import InputError
from scenefw.kernels.cameras import camera_of, stack_cameras
from scenefw.kernels.compile import compile_ahead
from scenefw.perception.observation.image_turns import quarter_turns, turned_pixels
from scenefw.perception.observation.object_masks import object_masks
from scenefw.perception.observation.observation import Observation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scenefw.core.protocols import FloorFinding, MappingMethod
    from scenefw.core.types import Frame, GridSpec, Int32
    from scenefw.perception.observation.doctor import Doctor
    from scenefw.perception.observation.workspace import WorkspaceFinder


@dataclass(frozen=True, eq=False)
class Observer:
    """Finds floor and objects of a depth image, and fuses it (thesis 5.2.4, real data).

    Args:
        mapping: from depth to partial TSDF.
        floor: finds the floor.
        workspace: finds the objects on it.
        doctor: checks the image before, and the floor and the objects after.
    """

    mapping: MappingMethod
    floor: FloorFinding
    workspace: WorkspaceFinder
    doctor: Doctor

    def observe(
        self, frame: Frame, grid: GridSpec, mask: NDArray[np.bool_] | Int32 | None = None
    ) -> Observation:
        """The observation of a frame.

        Args:
            frame: its camera needs no pose.
            grid: the cube about the objects.
            mask: (H, W) of what is known to be objects: booleans say where some are, whole numbers
                which one a pixel shows (0 = none). Anything else above the floor is then ignored.

        Raises:
            InputError: the image is unusable; the message says how to mend it.
        """
        warnings = self.doctor.examine_frame(frame)
        floor, floor_warnings = self.doctor.examine_floor(frame, self.floor)
        warnings += floor_warnings
        region = None if mask is None else mask > 0
        try:
            workspace = self.workspace.find(frame, floor, grid, region)
        except InputError as error:
            if not warnings:
                raise
            raise InputError(f"{error} ({'; '.join(warnings)})") from error
        warnings += self.doctor.examine_workspace(floor, workspace)
        turns = quarter_turns(floor)
        workspace = workspace.turned(turns)
        cameras = stack_cameras([workspace.frame.camera])
        compile_ahead()  # the image is usable
        partial = self.mapping.fuse(torch.from_numpy(workspace.frame.depth)[None], grid, cameras)
        marks = None
        if mask is not None and mask.dtype != np.bool_:
            ids = turned_pixels(mask.astype(np.int32), turns)
            marks = object_masks(ids, workspace, grid, floor.deviation)
            warnings += marks.warnings
        return Observation(
            replace(workspace.frame, camera=camera_of(cameras, 0)),  # as volumes know it
            partial,
            grid,
            None if marks is None else marks.pixels,
            frame,
            floor,
            workspace,
            tuple(warnings),
            ids=() if marks is None else marks.ids,
            turns=turns,
        )
