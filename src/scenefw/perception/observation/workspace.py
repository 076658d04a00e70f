"""The objects on the table, the cube around them, and the depth that a network should see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.floors import Floor
from scenefw.core.settings import COUNT, POSITIVE
from scenefw.core.types import Float32, Frame, GridSpec
from scenefw.fitting.placed import OUTLIERS
from scenefw.perception.observation.flat_things import flat_things
from scenefw.perception.observation.floor_noise import (
    MAX_FLOOR_HEIGHT,
    ROUNDING,
    FloorNoise,
    floor_sigma,
)
from scenefw.perception.observation.image_turns import turned, turned_pixels
from scenefw.perception.observation.object_groups import (
    fitting_groups,
    object_groups,
    pixel_weights,
)
from scenefw.perception.observation.obstacles import ObstacleFinding, ObstacleRegion, union
from scenefw.perception.observation.pixels import WIDTH
from scenefw.perception.observation.points import MAJORITY, world_points
from scenefw.perception.observation.raster import FloorRaster
from scenefw.perception.observation.support import standing_pixels

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_RASTER = FloorRaster()
OUTSIDE_CUBE = "objects outside the cube"
"""Kind of the obstacle that they are."""


@dataclass(frozen=True)
class Workspace:
    """A frame in the world frame of its stack: floor z = 0, objects around the z axis.

    Args:
        frame: its camera's pose is the estimated one; its depth is as the network should see it.
        objects: (H, W) bool, pixels of the objects that are in the cube.
        size: (3,) extent of these pixels' points along x and y, their height above the floor (m);
            0 if nothing stands on the table.
        left_out: (K, 2) x and y of object groups that don't fit into the cube with them (m).
        obstacles: what rises above the floor and is no object.
        unsupported: (H, W) bool, pixels in the cube of what stands somewhere else.
        points: (H, W, 3) of all pixels as they were measured (m), NaN = no depth.
        flat: (H, W) bool each, pixels of things that are too low for an object.
    """

    frame: Frame
    objects: Mask
    size: Array
    left_out: Array
    obstacles: tuple[ObstacleRegion, ...]
    unsupported: Mask
    points: Array
    flat: tuple[Mask, ...] = ()

    def turned(self, turns: int) -> Workspace:
        """The workspace of the image turned left by quarters."""
        obstacles = [
            replace(region, pixels=turned_pixels(region.pixels, turns)) for region in self.obstacles
        ]
        return replace(
            self,
            frame=turned(self.frame, turns),
            objects=turned_pixels(self.objects, turns),
            obstacles=tuple(obstacles),
            unsupported=turned_pixels(self.unsupported, turns),
            points=turned_pixels(self.points, turns),
            flat=tuple(turned_pixels(pixels, turns) for pixels in self.flat),
        )


@dataclass(frozen=True, eq=False)
class _Surfaces:
    """What the pixels (H, W) of a posed frame show."""

    frame: Frame
    points: Array
    min_height: Array
    raised: Mask
    on_floor: Mask
    objects: Mask
    obstacles: tuple[ObstacleRegion, ...] = ()
    flat: tuple[Mask, ...] = ()

    @property
    def surroundings(self) -> Mask:
        """What rises and is no object."""
        return self.raised & ~self.objects

    def without(self, pixels: Mask) -> _Surfaces:
        """The same with objects of some pixels left out: an arm must not hit them all the same."""
        obstacles = (*self.obstacles, ObstacleRegion(OUTSIDE_CUBE, pixels))
        return replace(self, objects=self.objects & ~pixels, obstacles=obstacles)


@dataclass(frozen=True, eq=False)
class WorkspaceFinder:
    """Extracts the objects on the table from a view and centres the cube on them.

    Obstacles, and what stands beside the table (`support`), become "no measurement"; points below
    the floor are moved up their rays onto it, so that the table looks endless, as the floor does in
    training.

    Args:
        obstacles: finds what is no object.
        floor_margin: no thing is as low (m). Nor is what the floor's errors reach, up to
            `MAX_FLOOR_HEIGHT`.
        min_pixels: of a thing, in an image 640 wide.

    Raises:
        ConfigError: a height that isn't positive, or less than one pixel.
    """

    obstacles: ObstacleFinding
    floor_margin: float = 0.005
    min_pixels: float = 60

    def __post_init__(self) -> None:
        POSITIVE.require(floor_margin=self.floor_margin)
        COUNT.require(min_pixels=self.min_pixels)

    def find(
        self, frame: Frame, floor: Floor, grid: GridSpec, region: Mask | None = None
    ) -> Workspace:
        """The workspace of a frame on its floor, for a cube; of a bare table, too.

        Args:
            frame: as it was read.
            floor: what the objects stand on.
            grid: the cube.
            region: (H, W) where objects are, if that is known: it takes the table's place.

        Raises:
            InputError: what stands on the table is larger than the cube, or nothing is where
                objects are known to be.
        """
        posed_frame = replace(frame, camera=frame.camera.moved(floor.T_world_camera))
        return self.find_together([posed_frame], grid, region)[0]

    def find_together(
        self, frames: Sequence[Frame], grid: GridSpec, region: Mask | None = None
    ) -> list[Workspace]:
        """The workspaces of frames of one scene, all in the same cube.

        Args:
            frames: with poses in a world whose floor is z = 0.
            grid: the cube.
            region: (H, W) where objects are in each, if that is known; else there may be none.

        Raises:
            InputError: as `find`.
        """
        top, side = grid.lower[2] + grid.extent, grid.extent - 2 * grid.voxel_size
        surfaces = [self._surfaces(frame, region) for frame in frames]
        object_masks = [s.objects & (s.points[..., 2] < top) for s in surfaces]
        weights = [pixel_weights(mask.shape)[mask] for mask in object_masks]
        object_points = _points_of(surfaces, object_masks)
        labels, groups = object_groups(object_points, np.concatenate(weights), side)
        if not groups:
            if region is not None or not any(s.on_floor.any() for s in surfaces):
                raise self._nothing(frames, top, region)
            return self._bare_workspaces(surfaces, grid)
        centre, members = fitting_groups(groups, side, _names(frames))
        far_groups = [g for g in groups if g not in members]
        left_out = [g.cells.mean(axis=0) - centre for g in far_groups]
        member_masks, far_masks = (
            [
                mask & np.isin(_RASTER.look_up(labels, s.points), [g.label for g in selection])
                for s, mask in zip(surfaces, object_masks, strict=True)
            ]
            for selection in (members, far_groups)
        )
        surfaces = [
            s.without(mask) if mask.any() else s
            for s, mask in zip(surfaces, far_masks, strict=True)
        ]
        member_points = _points_of(surfaces, member_masks)
        size = np.append(np.ptp(member_points[:, :2], axis=0), member_points[:, 2].max())
        return [
            self._workspace(s, mask, centre, size, np.array(left_out).reshape(-1, 2), grid)
            for s, mask in zip(surfaces, member_masks, strict=True)
        ]

    def _surfaces(self, frame: Frame, region: Mask | None) -> _Surfaces:
        """What the pixels of a posed frame show; of a known region, only objects are in it."""
        points = world_points(frame)
        heights = points[..., 2]
        noise = FloorNoise.of(heights, frame.depth)
        min_height = np.clip(noise.reach(frame.depth), self.floor_margin, MAX_FLOOR_HEIGHT)
        if region is not None:  # marks show some of the floor, too
            min_height = np.full(heights.shape, MAX_FLOOR_HEIGHT)
        raised = heights > min_height  # NaN where no depth: not raised
        on_floor = np.abs(heights) < min_height
        if region is not None:
            objects = raised & region
            if not objects.any():
                objects = _flat_pixels(heights, frame.depth, region)
            return _Surfaces(frame, points, min_height, raised, on_floor, objects)
        obstacles = tuple(self.obstacles.find(frame, points, raised, on_floor))
        things = raised & ~union(obstacles, raised.shape)
        min_pixels = self.min_pixels * (frame.depth.shape[1] / WIDTH) ** 2
        objects = standing_pixels(frame.depth, points, things, min_height, min_pixels)
        flat = tuple(
            pixels
            for pixels in flat_things(heights, noise.at(frame.depth), self.floor_margin)
            if objects[pixels].mean() < MAJORITY
        )
        return _Surfaces(frame, points, min_height, raised, on_floor, objects, obstacles, flat)

    def _nothing(self, frames: Sequence[Frame], top: float, region: Mask | None) -> InputError:
        return InputError(
            f"nothing stands on the floor of {_names(frames)}: no surface from "
            f"{self.floor_margin * 100:g} cm to {top * 100:.0f} cm above it; check that "
            f"objects are in view{'' if region is None else ', that the mask covers them'} and "
            "that the depth scale is right"
        )

    def _bare_workspaces(self, surfaces: Sequence[_Surfaces], grid: GridSpec) -> list[Workspace]:
        """Workspaces of a table on which nothing stands, about the middle of what is seen."""
        floor_points = _points_of(surfaces, [s.on_floor for s in surfaces])
        middle = np.median(floor_points[:, :2], axis=0)
        return [
            self._workspace(
                s, np.zeros(s.raised.shape, dtype=bool), middle, np.zeros(3), np.zeros((0, 2)), grid
            )
            for s in surfaces
        ]

    def _workspace(
        self,
        surfaces: _Surfaces,
        objects: Mask,
        centre: Array,
        size: Array,
        left_out: Array,
        grid: GridSpec,
    ) -> Workspace:
        frame, points = surfaces.frame, surfaces.points
        shift = geometry.rigid(np.eye(3), (-centre[0], -centre[1], 0.0))
        pose = shift @ frame.camera.T_world_camera
        depth = self._depth(surfaces)
        in_cube = np.all(
            np.abs(points - (*centre, grid.lower[2] + grid.extent / 2)) < grid.extent / 2, axis=-1
        )
        unsupported = surfaces.surroundings & ~union(surfaces.obstacles, in_cube.shape) & in_cube
        return Workspace(
            replace(frame, depth=depth, camera=frame.camera.moved(pose)),
            objects,
            size,
            left_out,
            surfaces.obstacles,
            unsupported,
            points - (*centre, 0.0),
            surfaces.flat,
        )

    def _depth(self, surfaces: _Surfaces) -> NDArray[np.float32]:
        frame, height = surfaces.frame, surfaces.points[..., 2]
        camera_height = frame.camera.T_world_camera[2, 3]
        with np.errstate(invalid="ignore"):
            floor_depth = frame.depth * camera_height / (camera_height - height)
        depth = np.where(height < -surfaces.min_height, floor_depth, frame.depth)
        return np.where(surfaces.surroundings, 0, depth).astype(np.float32)


def _flat_pixels(heights: Array, depth: Float32, region: Mask) -> Mask:
    """Where (H, W) flat things are that somebody has marked, a pen or a phone; on a floor nowhere.

    Args:
        heights: (H, W) above the floor (m), NaN = no depth.
        depth: (H, W) metres.
        region: (H, W) marked.
    """
    limit = OUTLIERS * np.maximum(floor_sigma(heights, depth) * depth**2, ROUNDING)
    marked = region & np.isfinite(heights)
    if not marked.any() or np.median((heights - limit)[marked]) < 0:
        return np.zeros_like(region)
    return region & (heights > limit)


def _points_of(surfaces: Sequence[_Surfaces], masks: Sequence[Mask]) -> Array:
    """Points (N, 3) of pixels of all views."""
    return np.concatenate([s.points[mask] for s, mask in zip(surfaces, masks, strict=True)])


def _names(frames: Sequence[Frame]) -> str:
    first_name, *further_names = (frame.name for frame in frames)
    return f"{first_name} and {len(further_names)} more" if further_names else first_name
