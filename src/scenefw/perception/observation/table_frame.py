"""Transforms frames to table coordinates: z up, table at z = 0, seen part around the origin.

Height maps lie on the table. A single image has no pose, tracked cameras start at the first one,
and recorded poses may be of any world, so the floor finder of prediction says where the table is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.protocols import FloorFinding
from scenefw.core.settings import POSITIVE
from scenefw.core.types import Float64, Frame
from scenefw.perception.observation.floor import TABLE_HEIGHT, FloorFinder
from scenefw.perception.observation.main_plane import WorldPlane, main_plane
from scenefw.perception.observation.points import world_points


@dataclass(frozen=True)
class Alignment:
    """The transform from the world of some poses to table coordinates.

    Args:
        T_table_world: (4, 4), takes the old world's coordinates to the table's.
        note: what was done, in words; empty if the poses were right already.
        table: whether a table was found.
    """

    T_table_world: Float64
    note: str = ""
    table: bool = True


@dataclass(frozen=True, eq=False)
class TableFrame:
    """Finds the table in a frame and the transform that brings it to z = 0.

    Args:
        floor: finds the table.
        max_depth: points farther from the camera don't say where the middle is (m).
        max_tilt: poses of a world whose plane z = 0 is off the table by no more than this are kept
            (degrees).
        max_offset: the same for its height (m).

    Raises:
        ConfigError: a number that isn't positive.
    """

    floor: FloorFinding = field(default_factory=FloorFinder)
    max_depth: float = 2.0
    max_tilt: float = 5.0
    max_offset: float = 0.03

    def __post_init__(self) -> None:
        POSITIVE.require(max_depth=self.max_depth, max_tilt=self.max_tilt)
        POSITIVE.require(max_offset=self.max_offset)

    def rectified(self, frame: Frame) -> Frame:
        """The frame in table coordinates, whatever its camera's pose was.

        Raises:
            InputError: no table is found.
        """
        pose = self._pose(frame)
        return replace(frame, camera=frame.camera.moved(pose))

    def alignment(
        self, frame: Frame, *, posed: bool, further_frames: Sequence[Frame] = ()
    ) -> Alignment:
        """The transform of a sequence to table coordinates.

        The table is the plane on which most of what all frames measured lies; the first frame may
        show another one.

        Args:
            frame: the first, with its pose in the old world.
            posed: whether the old world may be the table's: then it is kept if its plane z = 0
                holds the table (within `tilt` and `level`), or if no table is found.
            further_frames: more frames of the recording, with poses in the same world.

        Raises:
            InputError: no table is found, and the poses have none either.
        """
        planes: list[WorldPlane] = []
        errors: list[InputError] = []
        for view in (frame, *further_frames):
            try:
                planes.append(WorldPlane.of(self.floor.find(view), view))
            except InputError as error:
                errors.append(error)
        if not planes:
            if posed:
                return Alignment(np.eye(4), f"poses are used as they are: {errors[0]}", table=False)
            raise errors[0]
        plane = main_plane(planes)
        is_level = plane.normal[2] > np.cos(np.radians(self.max_tilt))
        if posed and is_level and abs(plane.level) < self.max_offset:
            return Alignment(np.eye(4))
        note = "the table was found in the first frame and is the map's plane z = 0"
        if plane.frame is not frame:
            note = (
                f"the table was found in frame {plane.frame.name}, as most of the recording shows "
                "it and the first frame doesn't, and is the map's plane z = 0"
            )
        camera_pose = np.asarray(plane.frame.camera.T_world_camera)
        return Alignment(self._pose(plane.frame) @ geometry.inverse(camera_pose), note)

    def _pose(self, frame: Frame) -> Float64:
        """Camera pose in table coordinates, with the origin in the middle of the seen part."""
        pose = self.floor.find(frame).T_world_camera
        points = world_points(replace(frame, camera=frame.camera.moved(pose)), stride=4)
        valid = frame.depth[::4, ::4] < self.max_depth
        valid &= np.abs(points[..., 2]) < TABLE_HEIGHT  # not what nothing was measured of, NaN
        middle = np.median(points[valid][:, :2], axis=0) if valid.any() else np.zeros(2)
        return geometry.rigid(np.eye(3), (-middle[0], -middle[1], 0.0)) @ pose
