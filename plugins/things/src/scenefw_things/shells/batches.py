"""Crops about single objects, and where their rays enter and leave them, as torch tensors.

torch is imported for type checkers only, so that these can be named without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from scenefw.core.batches import CameraBatch


@dataclass(frozen=True)
class ObjectCrops:
    """Square windows of depth images about N objects, thinned or enlarged to R x R pixels.

    Args:
        depth: (N, R, R) z-depth in metres, with the floor, 0 = no measurement.
        visible: (N, R, R) bool, measured pixels of the object.
        others: (N, R, R) bool, measured pixels of other objects and of obstacles.
        cameras: of the crops, the floor at z = 0.
        colour: (N, 3, R, R) from 0 to 1, NaN in crops without; None: no crop has any.
    """

    depth: Tensor
    visible: Tensor
    others: Tensor
    cameras: CameraBatch
    colour: Tensor | None = None

    def row(self, row: int) -> ObjectCrops:
        """One of the crops, as N = 1."""
        rows = slice(row, row + 1)
        colour = None if self.colour is None else self.colour[rows]
        return ObjectCrops(
            self.depth[rows], self.visible[rows], self.others[rows], self.cameras.of(row), colour
        )


@dataclass(frozen=True)
class Shells:
    """What rays through pixels of N crops pass of their objects, hidden parts too.

    Args:
        depths: (N, 4, R, R) z-depth in metres of ENTRY, EXIT, GAP_START and GAP_END; of a ray that
            passes several gaps the widest counts. Entry and exit matter where `amodal`, the others
            where `hollow`.
        amodal: (N, R, R) bool, rays that meet the object.
        hollow: (N, R, R) bool, rays that leave it and enter it again.
    """

    depths: Tensor
    amodal: Tensor
    hollow: Tensor


@dataclass(frozen=True)
class ObjectShellBatch:
    """Crops with the truth.

    Args:
        crops: of N objects.
        shells: of these objects.
        scales: (N,) width of each crop at its object (m), the unit of errors.
    """

    crops: ObjectCrops
    shells: Shells
    scales: Tensor


@dataclass(frozen=True)
class ShellPrediction:
    """Shells as a network says them.

    Args:
        amodal: (N, R, R) logits that a ray meets the object.
        hollow: (N, R, R) logits that it leaves it and enters it again.
        depths: (N, 4, R, R) as of `Shells`, in order along each ray.
        draws: of two random codes for each of the first crops; None: there are none.
    """

    amodal: Tensor
    hollow: Tensor
    depths: Tensor
    draws: tuple[ShellPrediction, ShellPrediction] | None = None


@dataclass(frozen=True)
class ShellSetup:
    """What losses may check before a training on shells starts.

    Args:
        drawn: crops of a batch for which the network draws codes.
    """

    drawn: int
