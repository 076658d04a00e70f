"""All checks of an image, with what was found up to the one that stopped it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenefw.core.errors import InputError
from scenefw.perception.observation.doctor import UNUSABLE, Check, Doctor, unusable

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from scenefw.core.floors import Floor
    from scenefw.core.protocols import FloorFinding
    from scenefw.core.types import Frame, GridSpec
    from scenefw.perception.observation.workspace import Workspace, WorkspaceFinder


@dataclass(frozen=True)
class Examination:
    """What is known of an image before a prediction.

    Args:
        checks: in their order; an unusable one is the last.
        frame: None if it can't be read.
        floor: None if none was found.
        workspace: None if it can't be placed; of a bare table it has no objects.
    """

    checks: tuple[Check, ...]
    frame: Frame | None = None
    floor: Floor | None = None
    workspace: Workspace | None = None

    @property
    def usable(self) -> bool:
        """Whether a prediction can be made."""
        return all(check.verdict != UNUSABLE for check in self.checks)


@dataclass(frozen=True, eq=False)
class Examiner:
    """Looks at images as a prediction would, up to the network.

    Args:
        floor: finds the floor.
        workspace: finds the objects on it.
        doctor: judges.
        grid: the cube that the objects must fit into.
    """

    floor: FloorFinding
    workspace: WorkspaceFinder
    doctor: Doctor
    grid: GridSpec

    def examine(
        self, frame: Frame, mask: NDArray[np.bool_] | NDArray[np.int32] | None = None
    ) -> Examination:
        """Every check that can be made.

        Args:
            frame: as read.
            mask: (H, W) above 0 where objects are known to be.
        """
        checks = self.doctor.check_frame(frame)
        if any(check.verdict == UNUSABLE for check in checks):
            return Examination(tuple(checks), frame)
        try:
            floor, floor_checks = self.doctor.find_floor(frame, self.floor)
        except InputError as error:
            return Examination((*checks, unusable("floor", error)), frame)
        checks += [*floor_checks, *self.doctor.check_floor(floor)]
        region = None if mask is None else mask > 0
        try:
            workspace = self.workspace.find(frame, floor, self.grid, region)
        except InputError as error:
            return Examination((*checks, unusable("objects", error)), frame, floor)
        checks += self.doctor.check_workspace(workspace)
        return Examination(tuple(checks), frame, floor, workspace)
