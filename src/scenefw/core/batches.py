"""What crosses a floor as torch tensors: batches of cameras, scenes, volumes and predictions.

torch is imported for type checkers only, so that these can be named without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor


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
    """Volumes of B scenes, objects alone (no floor).

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
    """What B depth images say of the grid.

    Args:
        distance: (B, 1, X, Y, Z) metres, +truncation where unseen.
        observed: (B, 1, X, Y, Z) bool: in front of a seen surface, or up to a voxel behind it.
    """

    distance: Tensor
    observed: Tensor


@dataclass(frozen=True)
class ShapeInstanceBatch:
    """One training or evaluation batch; distances in units of the truncation, so in [-1, 1].

    Args:
        condition: (B, C, X, Y, Z): partial TSDF, then (C = 2) observed as 0 or 1.
        tsdf: (B, 1, X, Y, Z).
        votes: (B, 3, X, Y, Z).
    """

    condition: Tensor
    tsdf: Tensor
    votes: Tensor


@dataclass(frozen=True)
class RedrawnShapes:
    """Shapes of some of a batch's views from a second code each, drawn like the first.

    Args:
        rows: of the batch, P of them.
        tsdf: (P, 1, X, Y, Z) distances in units of the truncation.
    """

    rows: slice
    tsdf: Tensor


@dataclass(frozen=True)
class ShapeInstancePrediction:
    """Output of a shape-and-instance network; distances in units of the truncation.

    Args:
        tsdf: (B, 1, X, Y, Z).
        votes: (B, 3, X, Y, Z), not normalised.
        partial: (B, 1, X, Y, Z) reconstruction of the condition, or None.
        latent: codes (L) of B views, or of those that an encoder saw in training, or None.
        statistics: further tensors by name, e.g. mean and log-variance of the code.
        redrawn: what other codes make of some of the views, or None.
    """

    tsdf: Tensor
    votes: Tensor
    partial: Tensor | None = None
    latent: Tensor | None = None
    statistics: Mapping[str, Tensor] = field(default_factory=dict)
    redrawn: RedrawnShapes | None = None


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
