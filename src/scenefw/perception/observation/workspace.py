"""The objects on the table, the cube around them, and the depth that a network should see."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.morphology import convex_hull_image

from scenefw.core import geometry
from scenefw.core.errors import InputError
from scenefw.core.floors import Floor
from scenefw.core.settings import NOT_NEGATIVE, POSITIVE
from scenefw.core.types import Frame, GridSpec
from scenefw.perception.observation.points import world_points
from scenefw.perception.observation.raster import FloorRaster

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_RASTER = FloorRaster()
_HOLES = 3  # cells: objects and their shadows cut the seen table
_RIM = 2  # cells: objects may reach over the seen table
_MIN_CELLS = 4  # of a group of objects
_MIN_POINTS = 30  # of a group of objects


@dataclass(frozen=True)
class Workspace:
    """A frame in the world frame of its stack: floor z = 0, objects around the z axis.

    Args:
        frame: its camera's pose is the estimated one; its depth is as the network should see it.
        objects: (H, W) bool, pixels of the objects that are in the cube.
        size: (3,) extent of these pixels' points along x and y, their height above the floor (m);
            0 if nothing stands on the table.
        left_out: (K, 2) x and y of object groups that don't fit into the cube with them (m).
    """

    frame: Frame
    objects: Mask
    size: Array
    left_out: Array


@dataclass(frozen=True)
class _Group:
    """A group of objects that (nearly) touch: number in the raster, cell centres (N, 2), points."""

    label: int
    cells: Array
    points: int


class WorkspaceFinder:
    """Extracts the objects on the table from a view and centres the cube on them.

    The table is the convex hull of the largest connected piece of floor. Points above the floor
    but beside the table are background and become "no measurement"; points below the floor are
    moved up their rays onto it, so that the table looks endless, as the floor does in training.

    Args:
        min_height: lower points belong to the floor (m).
        margin: objects stay this far from the cube's sides (m).

    Raises:
        ConfigError: a height that isn't positive, or a negative margin.
    """

    def __init__(self, min_height: float = 0.015, margin: float = 0.03) -> None:
        POSITIVE.require(min_height=min_height)
        NOT_NEGATIVE.require(margin=margin)
        self.min_height = min_height
        self.margin = margin

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
        return self._workspaces([posed_frame], grid, region)[0]

    def find_together(
        self, frames: Sequence[Frame], grid: GridSpec, region: Mask | None = None
    ) -> list[Workspace]:
        """The workspaces of frames of one scene, all in the same cube.

        Args:
            frames: with poses in a world whose floor is z = 0.
            grid: the cube.
            region: (H, W) where objects are in each, if that is known.

        Raises:
            InputError: as `find`.
        """
        return self._workspaces(frames, grid, region)

    def _workspaces(
        self, frames: Sequence[Frame], grid: GridSpec, region: Mask | None
    ) -> list[Workspace]:
        """The workspaces; where objects may be anywhere, there may be none."""
        points = [world_points(frame) for frame in frames]
        tables = [_table(p, self.min_height) if region is None else region for p in points]
        top = grid.lower[2] + grid.extent
        raised_masks = [t & self._raised_mask(p, top) for t, p in zip(tables, points, strict=True)]
        raised_points = np.concatenate(
            [p[mask] for p, mask in zip(points, raised_masks, strict=True)]
        )
        labels, groups = _groups(raised_points)
        if not groups and region is None and any(table.any() for table in tables):
            return self._bare_workspaces(frames, points, tables)
        if not groups:
            raise InputError(
                f"nothing stands on the floor of {_names(frames)}: no surface from "
                f"{self.min_height * 100:g} cm to {top * 100:.0f} cm above it; check that "
                f"objects are in view{'' if region is None else ', that the mask covers them'} and "
                "that the depth scale is right"
            )
        centre, members = _choose(groups, grid.extent - 2 * self.margin, _names(frames))
        left_out = [g.cells.mean(axis=0) - centre for g in groups if g not in members]
        member_labels = [g.label for g in members]
        member_masks = [np.isin(_RASTER.look_up(labels, p), member_labels) for p in points]
        objects = [i & mask for i, mask in zip(member_masks, raised_masks, strict=True)]
        object_points = np.concatenate([p[mask] for p, mask in zip(points, objects, strict=True)])
        size = np.append(np.ptp(object_points[:, :2], axis=0), object_points[:, 2].max())
        return [
            Workspace(
                self._centred_frame(frame, p, table, centre),
                mask,
                size,
                np.array(left_out).reshape(-1, 2),
            )
            for frame, p, table, mask in zip(frames, points, tables, objects, strict=True)
        ]

    def _bare_workspaces(
        self, frames: Sequence[Frame], points: Sequence[Array], tables: Sequence[Mask]
    ) -> list[Workspace]:
        """Workspaces of a table on which nothing stands, about the middle of what is seen."""
        table_points = [p[table] for p, table in zip(points, tables, strict=True)]
        middle = np.median(np.concatenate(table_points)[:, :2], axis=0)
        return [
            Workspace(
                self._centred_frame(frame, p, table, middle),
                np.zeros(table.shape, dtype=bool),
                np.zeros(3),
                np.zeros((0, 2)),
            )
            for frame, p, table in zip(frames, points, tables, strict=True)
        ]

    def _raised_mask(self, points: Array, top: float) -> Mask:
        """Which points (H, W, 3) lie above the floor, and below the cube's top (m)."""
        height = points[..., 2]  # NaN where no depth: not raised
        return (height > self.min_height) & (height < top)

    def _centred_frame(self, frame: Frame, points: Array, table: Mask, centre: Array) -> Frame:
        shift = geometry.rigid(np.eye(3), (-centre[0], -centre[1], 0.0))
        pose = shift @ frame.camera.T_world_camera
        depth = self._depth(frame, points, table)
        return replace(frame, depth=depth, camera=frame.camera.moved(pose))

    def _depth(self, frame: Frame, points: Array, table: Mask) -> NDArray[np.float32]:
        height = points[..., 2]
        camera_height = frame.camera.T_world_camera[2, 3]
        with np.errstate(invalid="ignore"):
            floor_depth = frame.depth * camera_height / (camera_height - height)
        depth = np.where(height < -self.min_height, floor_depth, frame.depth)
        return np.where((height > self.min_height) & ~table, 0, depth).astype(np.float32)


def _table(points: Array, tolerance: float) -> Mask:
    """Which points (H, W, 3) lie over the table: the hull of the largest piece of floor."""
    floor = _RASTER.count(points[np.abs(points[..., 2]) < tolerance]) > 0
    closed_floor = ndimage.binary_closing(floor, iterations=_HOLES)
    pieces, number = ndimage.label(closed_floor)
    if number == 0:
        return np.zeros(points.shape[:2], dtype=bool)
    sizes = ndimage.sum_labels(closed_floor, pieces, np.arange(1, number + 1))
    hull = convex_hull_image(pieces == 1 + int(np.argmax(sizes)))
    hull = ndimage.binary_dilation(hull, iterations=_RIM)
    return _RASTER.look_up(hull, points).astype(bool)


def _groups(points: Array) -> tuple[NDArray[np.int32], list[_Group]]:
    """Raster of group numbers, and the groups of object points (N, 3) that are not noise."""
    counts = _RASTER.count(points)
    occupied = counts > 0
    labels, number = ndimage.label(ndimage.binary_dilation(occupied), structure=np.ones((3, 3)))
    labels = np.where(occupied, labels, 0)
    groups = []
    for label in range(1, number + 1):
        mask = labels == label
        group = _Group(label, _RASTER.centres(mask), int(counts[mask].sum()))
        if len(group.cells) >= _MIN_CELLS and group.points >= _MIN_POINTS:
            groups.append(group)
    return labels, groups


def _choose(groups: list[_Group], side: float, name: str) -> tuple[Array, list[_Group]]:
    """Centre (2,) and members of the set of groups with most points that a square of `side` holds.

    Each group in turn takes in its neighbours, nearest first, as long as all fit.
    """
    best: list[_Group] = []
    for seed in groups:
        members: list[_Group] = []
        for group in sorted(groups, key=lambda g: _distance(seed, g)):
            if _span([*members, group]).max() <= side:
                members.append(group)
        if sum(g.points for g in members) > sum(g.points for g in best):
            best = members
    if not best:
        largest = _span([max(groups, key=lambda g: g.points)])
        raise InputError(
            f"objects of {name} cover {largest[0]:.2f} m x {largest[1]:.2f} m without a gap, the "
            f"cube holds {side:.2f} m; show fewer objects, or check depth scale and intrinsics"
        )
    cells = np.concatenate([g.cells for g in best])
    return (cells.min(axis=0) + cells.max(axis=0)) / 2, best


def _names(frames: Sequence[Frame]) -> str:
    first_name, *further_names = (frame.name for frame in frames)
    return f"{first_name} and {len(further_names)} more" if further_names else first_name


def _span(groups: list[_Group]) -> Array:
    return np.ptp(np.concatenate([g.cells for g in groups]), axis=0)


def _distance(a: _Group, b: _Group) -> float:
    return float(np.linalg.norm(a.cells.mean(axis=0) - b.cells.mean(axis=0)))
