"""Data that crosses floors as torch tensors: batches of cameras, scenes, volumes and predictions.

What one chapter alone needs has a module of its own: `object_sets`, `set_flows` and `part_views`.

torch is imported for type checkers only, so that these can be named without it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.types import GridSpec, PlacedShape, TriangleMesh


@dataclass(frozen=True)
class CameraBatch:
    """B cameras of one image size as tensors on the device that renders.

    Args:
        width, height: pixels.
        intrinsics: (B, 4) float32: fx, fy, cx, cy.
        T_world_camera: (B, 4, 4) float32.
    """

    width: int
    height: int
    intrinsics: Tensor
    T_world_camera: Tensor

    def of(self, rows: int | Tensor) -> CameraBatch:
        """Some of the cameras as a batch, by their numbers (R,); one number is a batch of one."""
        picked = slice(rows, rows + 1) if isinstance(rows, int) else rows
        intrinsics, poses = self.intrinsics[picked], self.T_world_camera[picked]
        return CameraBatch(self.width, self.height, intrinsics, poses)


@dataclass(frozen=True)
class SceneParameters:
    """B scenes of up to N superquadrics (eq. 5.1) as tensors on the device that computes volumes.

    Args:
        half_axes: (B, N, 3) float32 metres.
        exponents: (B, N, 3) float32: r, s, t of eq. 5.1.
        rotations: (B, N, 3, 3) float32, object to world.
        positions: (B, N, 3) float32 metres, world.
        present: (B, N) bool; absent objects fill up the batch.
    """

    half_axes: Tensor
    exponents: Tensor
    rotations: Tensor
    positions: Tensor
    present: Tensor


@dataclass(frozen=True)
class SceneVolumes:
    """Volumes of B scenes, only objects (no floor).

    Args:
        tsdf: (B, 1, X, Y, Z) metres, negative inside, cut at +-truncation.
        votes: (B, 3, X, Y, Z) unit vectors to the object's centre of mass, 0 where no object.
        instances: (B, X, Y, Z) int32, 0 = no object, i + 1 = objects[i].
    """

    tsdf: Tensor
    votes: Tensor
    instances: Tensor


@dataclass(frozen=True)
class PartialTSDF:
    """What B depth images tell about the grid.

    Args:
        distance: (B, 1, X, Y, Z) metres, +truncation where unseen.
        observed: (B, 1, X, Y, Z) bool: in front of a seen surface, or up to a voxel behind it.
        depth: (B, H, W) z-depth (m) that it was made of, for methods that look at pixels, or None.
        cameras: of these images, or None.
    """

    distance: Tensor
    observed: Tensor
    depth: Tensor | None = None
    cameras: CameraBatch | None = None

    def of(self, index: int) -> PartialTSDF:
        """One view as a batch of one, without its image."""
        return PartialTSDF(self.distance[index : index + 1], self.observed[index : index + 1])

    def merge(self, other: PartialTSDF) -> PartialTSDF:
        """Both views of each scene as one, without images: the smaller |distance| wins (eq. 5.19).

        A voxel is observed if either view observes it.
        """
        nearer = other.distance.abs() < self.distance.abs()
        distance = other.distance.where(nearer, self.distance)
        return PartialTSDF(distance, self.observed | other.observed)


@dataclass(frozen=True)
class IndexBatch:
    """Positions of samples in their split, and the epoch that takes them."""

    epoch: int
    indices: Tensor

    def to(self, *_args: Any, **_options: Any) -> IndexBatch:
        """Itself: indices stay where the parameters are."""
        return self


@dataclass(frozen=True)
class ShapeInstanceBatch:
    """One training or validation batch, in the units of the network.

    Args:
        condition: (B, 2, X, Y, Z): partial TSDF in units of the truncation, in [-1, 1], and 1 where
            observed, else 0. A network takes the channels that it needs.
        targets: complete scenes (B, C, X, Y, Z) by name of the representation.
        truths: the same in the units of the representations; in validation alone.
    """

    condition: Tensor
    targets: Mapping[str, Tensor]
    truths: Mapping[str, Tensor] = field(default_factory=dict)

    @property
    def tsdf(self) -> Tensor:
        """(B, 1, X, Y, Z) distances in units of the truncation."""
        return self.targets["tsdf"]

    @property
    def votes(self) -> Tensor:
        """(B, 3, X, Y, Z) votes, unit vectors or 0."""
        return self.targets["votes"]


@dataclass(frozen=True)
class RedrawnShapes:
    """Predictions of some of a batch's views from a second code each, drawn like the first.

    Args:
        rows: of the batch, P of them.
        volumes: outputs (P, C, X, Y, Z) by name.
    """

    rows: slice
    volumes: Mapping[str, Tensor]

    @property
    def tsdf(self) -> Tensor:
        """(P, 1, X, Y, Z) distances in units of the truncation."""
        return self.volumes["tsdf"]


@dataclass(frozen=True)
class ShapeInstancePrediction:
    """Output of a shape-and-instance network, in its own units.

    Args:
        volumes: outputs (B, C, X, Y, Z) by name of the representation.
        partial: (B, 1, X, Y, Z) reconstruction of the condition, or None.
        latent: codes (L) of B views, or of those that an encoder saw in training, or None.
        statistics: further tensors by name, e.g. mean and log-variance of the code.
        redrawn: what other codes make of some of the views, or None.
    """

    volumes: Mapping[str, Tensor]
    partial: Tensor | None = None
    latent: Tensor | None = None
    statistics: Mapping[str, Tensor] = field(default_factory=dict)
    redrawn: RedrawnShapes | None = None

    @property
    def tsdf(self) -> Tensor:
        """(B, 1, X, Y, Z) distances in units of the truncation."""
        return self.volumes["tsdf"]

    @property
    def votes(self) -> Tensor:
        """(B, 3, X, Y, Z) votes, not normalised."""
        return self.volumes["votes"]


@dataclass(frozen=True)
class ShapeInstanceSetup:
    """What losses may check before a training on volumes starts.

    Args:
        grid: the voxel grid.
        targets: channels of each volume by name.
        batch_size: views per step.
        redrawn: how many of them get two codes from the prior.
    """

    grid: GridSpec
    targets: Mapping[str, int]
    batch_size: int
    redrawn: int


@dataclass(frozen=True)
class Completion:
    """Complete scenes that a network makes of B partial views with one code each.

    Args:
        tsdf: (B, X, Y, Z) metres.
        instances: (B, X, Y, Z) int32.
        volumes: (B, C, X, Y, Z) by name, as their representations say them.
        masks: (B, H, W) int32, instances that pixels show, 0 = none; None: the method has none.
        placed: for each view, the shapes that explain some of its instances, by label.
        meshes: for each view, closed surfaces (m) of instances that voxels are too coarse for.
    """

    tsdf: Tensor
    instances: Tensor
    volumes: Mapping[str, Tensor] = field(default_factory=dict)
    masks: Tensor | None = None
    placed: Sequence[Mapping[int, PlacedShape]] = ()
    meshes: Sequence[Mapping[int, TriangleMesh]] = ()


@dataclass(frozen=True)
class SegmentationSetup:
    """What losses may check before a training on labels starts.

    Args:
        classes: names by class id.
    """

    classes: Sequence[str]


@dataclass(frozen=True)
class SegmentationBatch:
    """B labelled images or crops of maps.

    Args:
        colour: (B, 3, H, W) float32 in [0, 1].
        distance: (B, 1, H, W) float32 depth or height (m), NaN = missing.
        labels: (B, H, W) int64 class ids, -1 = unknown.
    """

    colour: Tensor
    distance: Tensor
    labels: Tensor


@dataclass(frozen=True)
class SeenSurface:
    """What B cameras see.

    Args:
        depth: (B, H, W) z-depth in metres, 0 = nothing hit.
        normals: (B, 3, H, W) unit vectors in the world frame, (0, 0, 1) on the floor, 0 = nothing.
        instances: (B, H, W) int32: labels, 0 = floor or unlabelled surface, -1 = nothing hit.
    """

    depth: Tensor
    normals: Tensor
    instances: Tensor
