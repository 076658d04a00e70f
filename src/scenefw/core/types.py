"""What crosses a floor: frozen data of scenes, cameras and estimates, all of it numpy.

Batches of torch tensors are in `core.batches`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scenefw.core import geometry
from scenefw.core.errors import ConfigError, InputError

Float64 = NDArray[np.float64]
Float32 = NDArray[np.float32]
Int32 = NDArray[np.int32]


@dataclass(frozen=True)
class Pose:
    """A rigid pose: object (or camera) coordinates to world coordinates.

    Args:
        position: (3,) metres.
        quaternion: (4,) in the order (w, x, y, z), unit, w >= 0.
    """

    position: Float64
    quaternion: Float64

    @classmethod
    def from_matrix(cls, matrix: Float64) -> Pose:
        """The pose of a rigid 4x4 matrix."""
        return cls(np.array(matrix[:3, 3]), geometry.quaternion_from_rotation(matrix[:3, :3]))

    @functools.cached_property
    def rotation(self) -> Float64:
        """The rotation matrix (3, 3)."""
        return geometry.rotation_from_quaternion(self.quaternion)

    @property
    def matrix(self) -> Float64:
        """The 4x4 matrix, float64."""
        return geometry.rigid(self.rotation, self.position)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera, OpenCV frame (x right, y down, z forward), pixel centres at integers.

    Args:
        width, height: pixels.
        fx, fy, cx, cy: intrinsics in pixels.
        T_world_camera: 4x4 float64, camera to world coordinates.
    """

    width: int = 640
    height: int = 480
    fx: float = 579.4
    fy: float = 579.4
    cx: float = 319.5
    cy: float = 239.5
    T_world_camera: Float64 = field(default_factory=lambda: np.eye(4))

    @property
    def matrix(self) -> Float64:
        """The intrinsic matrix K (3, 3)."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], dtype=np.float64)

    def resized(self, width: int, height: int) -> Camera:
        """The camera whose image is resampled to another size, pixel centres kept at integers."""
        sx, sy = width / self.width, height / self.height
        return Camera(
            width,
            height,
            self.fx * sx,
            self.fy * sy,
            (self.cx + 0.5) * sx - 0.5,
            (self.cy + 0.5) * sy - 0.5,
            self.T_world_camera,
        )

    def moved(self, T_world_camera: Float64) -> Camera:  # noqa: N803
        """The same camera elsewhere."""
        return Camera(self.width, self.height, self.fx, self.fy, self.cx, self.cy, T_world_camera)


_FINEST = 1024  # voxels per side


@dataclass(frozen=True)
class GridSpec:
    """A cubic voxel grid; samples sit at voxel centres, index order (x, y, z).

    Args:
        resolution: voxels per side.
        extent: side of the cube (m).
        lower: lowest corner of the cube in world coordinates (m).
        truncation_voxels: signed distances are cut at this many voxels.
    """

    resolution: int = 64
    extent: float = 1.0
    lower: tuple[float, float, float] = (-0.5, -0.5, -0.096)
    truncation_voxels: float = 5.0

    def __post_init__(self) -> None:
        if self.resolution < 2 or not self.extent > 0 or not self.truncation_voxels > 0:
            raise ConfigError(
                f"{self} is not a voxel grid; give 2 voxels or more and positive lengths"
            )
        if self.resolution > _FINEST:
            raise ConfigError(
                f"a voxel grid of {self.resolution} voxels per side doesn't fit into memory; give "
                f"at most {_FINEST}, each volume of which takes 4 GB"
            )
        object.__setattr__(self, "lower", tuple(float(x) for x in self.lower))  # configs hold lists

    @property
    def voxel_size(self) -> float:
        """Side of a voxel (m)."""
        return self.extent / self.resolution

    @property
    def truncation(self) -> float:
        """Truncation distance (m)."""
        return self.truncation_voxels * self.voxel_size

    @property
    def shape(self) -> tuple[int, int, int]:
        """(X, Y, Z)."""
        return (self.resolution,) * 3

    def centres(self) -> Float64:
        """World coordinates of all voxel centres, (X, Y, Z, 3); they can't be written to."""
        return _centres(self)

    def to_voxels(self, points: Float64) -> Float64:
        """Continuous voxel coordinates (..., 3): 0 is the centre of the first voxel."""
        return (np.asarray(points) - self.lower) / self.voxel_size - 0.5

    def nearest_voxels(self, points: Float64) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Voxels (..., 3) that points (..., 3) are in, and whether (...) these are of the grid."""
        voxels = np.rint(self.to_voxels(points)).astype(np.int64)
        return voxels, np.asarray(((voxels >= 0) & (voxels < self.resolution)).all(axis=-1))

    def box_about(self, points: Float64) -> tuple[slice, slice, slice]:
        """Voxels of the box about points (N, 3), wider by the truncation distance.

        Args:
            points: world coordinates (m).
        """
        ends = points.min(axis=0) - self.truncation, points.max(axis=0) + self.truncation
        low = np.clip(np.floor(self.to_voxels(ends[0])), 0, self.resolution).astype(int)
        high = np.clip(np.ceil(self.to_voxels(ends[1])) + 1, 0, self.resolution).astype(int)
        x, y, z = (slice(a, b) for a, b in zip(low.tolist(), high.tolist(), strict=True))
        return x, y, z

    def to_world(self, voxels: Float64) -> Float64:
        """World coordinates (..., 3) of continuous voxel coordinates."""
        return (np.asarray(voxels) + 0.5) * self.voxel_size + self.lower


@functools.lru_cache(maxsize=4)
def _centres(grid: GridSpec) -> Float64:
    axes = [low + (np.arange(grid.resolution) + 0.5) * grid.voxel_size for low in grid.lower]
    centres: Float64 = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    centres.flags.writeable = False
    return centres


@dataclass(frozen=True)
class Frame:
    """One view: z-depth (H, W) float32 in metres, 0 = no measurement, with what else is known.

    Args:
        depth: (H, W) float32 metres.
        camera: intrinsics and pose.
        colour: (H, W, 3) uint8 or None.
        labels: (H, W) int32 instance or class ids, 0 = no object or the first class (the
            surface), -1 = unknown; or None.
        name: where the frame comes from.
        notes: what its file left open and how it was read, a line each, for whoever asked for it.
        undistort: frees other images (H, W) of the same pixels of the lens, as its own were;
            None: there was nothing to do.
    """

    depth: Float32
    camera: Camera
    colour: NDArray[np.uint8] | None = None
    labels: Int32 | None = None
    name: str = ""
    notes: tuple[str, ...] = ()
    undistort: Callable[[NDArray[Any]], NDArray[Any]] | None = None

    def __post_init__(self) -> None:
        if self.depth.shape != (self.camera.height, self.camera.width):
            raise InputError(
                f"depth image {self.name} has shape {self.depth.shape}, but its camera is "
                f"{self.camera.height} x {self.camera.width}; give intrinsics of this image size"
            )


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Vertices (V, 3) float64 metres, faces (F, 3) int64, counter-clockwise from outside.

    Equal only to itself, so that what is computed of a mesh can be kept as long as the mesh.
    """

    vertices: Float64
    faces: NDArray[np.int64]


@runtime_checkable
class Shape(Protocol):
    """A rigid shape in its own frame, centre of mass at the origin."""

    def mesh(self) -> TriangleMesh:
        """Its watertight surface (m)."""

    def volume(self) -> float:
        """Its volume (m^3)."""


@dataclass(frozen=True)
class PlacedShape:
    """A shape and where it is."""

    shape: Shape
    pose: Pose

    def mesh(self) -> TriangleMesh:
        """Its surface in world coordinates, the same mesh each time."""
        return self._mesh

    @functools.cached_property
    def _mesh(self) -> TriangleMesh:
        mesh = self.shape.mesh()
        return TriangleMesh(geometry.transform_points(self.pose.matrix, mesh.vertices), mesh.faces)


@dataclass(frozen=True)
class SceneObject:
    """One rigid object: a shape (origin = centre of mass), where it is, its mass (kg)."""

    shape: Shape
    pose: Pose
    mass: float


@dataclass(frozen=True)
class Scene:
    """Objects at rest on the floor z = 0: pure data that simulators and renderers view.

    Args:
        objects: the objects; instance label i + 1 belongs to objects[i].
        index: number of the attempt that made it, with the seed the scene's identity.
        seed: seed of the data set.
        split: part of the data set that it belongs to; None leaves that to who stores it.
    """

    objects: tuple[SceneObject, ...]
    index: int = 0
    seed: int = 0
    split: str | None = None


@dataclass(frozen=True)
class ObjectEstimate:
    """One predicted object.

    Args:
        id: instance label, >= 1.
        mesh: watertight surface in world coordinates.
        pose: centre of mass and principal axes in world coordinates.
        extents: (3,) full size along the axes of `pose` (m).
        confidence: in [0, 1].
        placed: the shape that explains it, whose surface the mesh is; None if it has no such.
        cues: numbers that its confidence is made of, by name; empty if it has other reasons.
    """

    id: int
    mesh: TriangleMesh
    pose: Pose
    extents: Float64
    confidence: float
    placed: PlacedShape | None = None
    cues: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Obstacle:
    """What rises above the floor and is no object: an arm must not hit it.

    Args:
        kind: what it is taken for, in a word or two.
        mesh: of what is seen of it, in the frame of the floor; open.
    """

    kind: str
    mesh: TriangleMesh


@dataclass(frozen=True, eq=False)
class SceneEstimate:
    """What a depth image shows and hides: complete objects in the frame of the floor.

    Args:
        objects: in the order of their ids.
        grid: voxel grid of `tsdf` and `instances`.
        tsdf: (X, Y, Z) float32 metres.
        instances: (X, Y, Z) int32.
        frame: the view in the world frame (its camera's pose is the estimated one).
        details: flat facts worth keeping (floor, versions, checkpoint, warnings).
        volumes: what else the network says (C, X, Y, Z), by name of the representation.
        masks: (H, W) id of the object that each pixel of the frame shows, also of pixels without
            depth within an object, 0 = none; None if the method doesn't say.
        obstacles: walls, robots, containers.
    """

    objects: tuple[ObjectEstimate, ...]
    grid: GridSpec
    tsdf: Float32
    instances: Int32
    frame: Frame
    details: Mapping[str, Any] = field(default_factory=dict)
    volumes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    masks: Int32 | None = None
    obstacles: tuple[Obstacle, ...] = ()
