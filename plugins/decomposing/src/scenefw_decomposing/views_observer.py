"""Brings depth images of one scene into the frame of their table, and checks them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch

from scenefw.core.errors import InputError
from scenefw.data.files.sequences import transformed
from scenefw.kernels.cameras import stack_cameras
from scenefw.mapping.several_views import require_agreement
from scenefw.perception.observation.observation import Observation
from scenefw.perception.observation.views import Views

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenefw.core.protocols import MappingMethod
    from scenefw.core.types import Frame, GridSpec
    from scenefw.perception.observation.doctor import Doctor
    from scenefw.perception.observation.table_frame import TableFrame
    from scenefw.perception.observation.workspace import Workspace, WorkspaceFinder


@dataclass(frozen=True, eq=False)
class ViewsObserver:
    """Finds table and objects of posed depth images, and fuses each.

    Args:
        mapping: from depth to partial TSDF.
        table: finds the table, if the poses are of another world.
        workspace: finds the objects on it.
        doctor: checks the images before, and the objects after.
    """

    mapping: MappingMethod
    table: TableFrame
    workspace: WorkspaceFinder
    doctor: Doctor

    def observe(self, frames: Sequence[Frame], grid: GridSpec, mask: None = None) -> Views:
        """The views of frames whose poses are in one world.

        Args:
            frames: of one scene.
            grid: the cube about the objects.
            mask: objects can't be marked in several views.

        Raises:
            InputError: there is no frame, or one is unusable; or they are of several scenes.
        """
        if not frames:
            raise InputError("there is no view; give at least one depth image with its pose")
        if mask is not None:
            raise InputError("masks are of one view; leave them out")
        warnings = [line for frame in frames for line in self.doctor.examine_frame(frame)]
        alignment = self.table.alignment(frames[0], posed=True, further_frames=frames[1:])
        if not alignment.table:
            warnings.append(alignment.note)
        posed_frames = list(transformed(frames, alignment.T_table_world))
        workspaces = self.workspace.find_together(posed_frames, grid)
        warnings += self.doctor.examine_workspaces(workspaces)
        observations = tuple(self._observation(workspace, grid) for workspace in workspaces)
        require_agreement([view.partial for view in observations], grid)
        input_camera, output_camera = frames[0].camera, observations[0].camera
        T_views_input = output_camera.T_world_camera @ np.linalg.inv(input_camera.T_world_camera)  # noqa: N806
        table = "found in the images" if alignment.note else "the plane z = 0 of the poses"
        return Views(observations, T_views_input, tuple(dict.fromkeys(warnings)), table)

    def _observation(self, workspace: Workspace, grid: GridSpec) -> Observation:
        frame = workspace.frame
        depth = torch.from_numpy(frame.depth)[None]
        partial = self.mapping.fuse(depth, grid, stack_cameras([frame.camera]))
        return Observation(frame, partial, grid, workspace=workspace)
