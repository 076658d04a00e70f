"""What a view shows of objects, as networks of sets take it, and drawn sets in the world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from scenefw.core import geometry
from scenefw.core.batches import SceneParameters
from scenefw.core.errors import InputError
from scenefw.core.evidence import FittedSuperquadric
from scenefw.core.set_flows import SetFlowBatch
from scenefw.core.types import Pose
from scenefw.data.batches.object_ends import object_ends
from scenefw.data.batches.view_frames import in_frame, view_frame
from scenefw.data.batches.view_samples import ObjectSamples
from scenefw.fitting.placed import MIN_HALF_AXIS, signed_distance
from scenefw.perception.observation.points import points_by_label
from scenefw.shapes.equal_descriptions import equal_descriptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.random import Generator
    from numpy.typing import NDArray
    from torch import Tensor

    from scenefw.core.types import Float64, Int32
    from scenefw.perception.observation.observation import ViewGeometry

_DEFAULT_SAMPLES = ObjectSamples()


class ExtentInputs:
    """What a view shows of objects that were fitted to it, in the frame in which networks see it.

    Args:
        view: one camera's.
        masks: (H, W) which object a pixel shows.
        labels: of objects in the masks, one slot each.
        fitted: superquadrics that explain them.
        random: says which points are taken.
        inlier_distance: points further from the fit belong to something else (m).
        rows: how often they are shown, each time by other points.
        samples: how much of each, as in the network's training.
    """

    def __init__(
        self,
        view: ViewGeometry,
        masks: Int32,
        labels: Sequence[int],
        fitted: Sequence[FittedSuperquadric],
        random: Generator,
        inlier_distance: float,
        rows: int = 1,
        samples: ObjectSamples = _DEFAULT_SAMPLES,
    ) -> None:
        if view.eye is None:
            raise InputError(
                "a flow of sets draws what one camera sees, and this view has no camera; complete "
                "several views by several_views=fitted_parts"
            )
        points = torch.zeros(rows, len(labels), samples.points, 3)
        sizes = torch.zeros(rows, len(labels))
        visible_points = points_by_label(masks, view.points)
        for slot, label in enumerate(labels):
            object_points = visible_points[label]
            sizes[:, slot] = len(object_points) / masks.size
            inliers = object_points[
                np.abs(signed_distance(fitted[slot], object_points)) < inlier_distance
            ]
            object_points = inliers if len(inliers) else object_points
            indices = random.integers(len(object_points), size=(rows, samples.points))
            points[:, slot] = torch.from_numpy(object_points[indices])
        eye = torch.from_numpy(np.asarray(view.eye, dtype=np.float32)).expand(rows, 3)
        visible = torch.ones(rows, len(labels), dtype=torch.bool)
        self._inputs = points, visible, sizes, _ends(view, masks, labels, eye, random, samples), eye
        self._turn, self._origin = view_frame(points, visible, eye)

    def batch(self, objects: Sequence[FittedSuperquadric], device: torch.device) -> SetFlowBatch:
        """The view in its rows, and what its objects are taken to be.

        Args:
            objects: one for each label.
            device: where the batch goes.
        """
        scenes = _scenes_of(objects, len(self._origin))
        fields: dict[str, Tensor] = vars(in_frame(*self._inputs, scenes))
        return SetFlowBatch(**{name: value.to(device) for name, value in fields.items()})

    def in_world(self, samples: SetFlowBatch) -> WorldSets:
        """Sets that a network drew for this view, set k for row k, then for the first again."""
        rows = torch.arange(len(samples.positions)) % len(self._origin)
        to_world = self._turn[rows].transpose(-1, -2).double()[:, None]
        offsets = (to_world @ samples.positions.double().cpu()[..., None])[..., 0]
        positions = offsets + self._origin[rows].double()[:, None]
        return WorldSets(
            samples.half_axes.double().cpu().numpy(),
            samples.exponents.double().cpu().numpy(),
            (to_world @ samples.rotations.double().cpu()).numpy(),
            positions.numpy(),
            samples.present.cpu().numpy(),
        )


@dataclass(frozen=True)
class WorldSets:
    """S drawn sets of up to N superquadrics, in world coordinates.

    Args:
        half_axes: (S, N, 3) m.
        exponents: (S, N, 3).
        rotations: (S, N, 3, 3), object to world.
        positions: (S, N, 3) m.
        present: (S, N).
    """

    half_axes: Float64
    exponents: Float64
    rotations: Float64
    positions: Float64
    present: NDArray[np.bool_]

    def objects(self, row: int, first: int = 0) -> list[FittedSuperquadric]:
        """The objects of one set.

        Args:
            row: which set.
            first: slots before that are left out.
        """
        return [
            FittedSuperquadric(
                self.half_axes[row, k],
                self.exponents[row, k],
                Pose(
                    self.positions[row, k],
                    geometry.quaternion_from_rotation(self.rotations[row, k]),
                ),
                0.0,
                np.empty(0),
            )
            for k in range(first, self.present.shape[1])
            if self.present[row, k]
        ]

    def middle(self, rows: slice, fitted: Sequence[FittedSuperquadric]) -> list[FittedSuperquadric]:
        """Seen objects with faces and exponents in the middle of those of some draws.

        Args:
            rows: the draws.
            fitted: superquadrics whose axes they have.
        """
        return [self._median_object(k, rows, superquadric) for k, superquadric in enumerate(fitted)]

    def _median_object(self, k: int, rows: slice, fitted: FittedSuperquadric) -> FittedSuperquadric:
        axes = fitted.pose.rotation
        centres = self.positions[rows, k] @ axes
        halves, exponents = (
            np.array(
                [along(axes, *pair) for pair in zip(self.rotations[rows, k], values, strict=True)]
            )
            for values in (self.half_axes[rows, k], self.exponents[rows, k])
        )
        low, high = np.median(centres - halves, axis=0), np.median(centres + halves, axis=0)
        pose = Pose(axes @ (low + high) / 2, fitted.pose.quaternion)
        half_axes = np.maximum((high - low) / 2, MIN_HALF_AXIS)
        return FittedSuperquadric(half_axes, np.median(exponents, axis=0), pose, 0.0, np.empty(0))


_EQUAL_ROTATIONS = equal_descriptions().numpy().astype(np.float64)


def along(axes: Float64, rotation: Float64, numbers: Float64) -> Float64:
    """Numbers (3,) of an object's axes, in the order of other axes that are nearly its own.

    Args:
        axes: (3, 3), columns are the axes.
        rotation: (3, 3) of the object.
        numbers: (3,) half-axes or exponents of the object.
    """
    agreement = np.einsum("ij,ik,wkj->w", axes, rotation, _EQUAL_ROTATIONS)
    return np.asarray(np.abs(_EQUAL_ROTATIONS[agreement.argmax()]).T @ numbers)


def _ends(
    view: ViewGeometry,
    masks: Int32,
    labels: Sequence[int],
    eye: Tensor,
    random: Generator,
    samples: ObjectSamples,
) -> Tensor:
    """Where the images of objects end (1, N, E, 7), at the resolution of training."""
    step = max(1, round(masks.shape[1] / samples.width))
    masks = masks[::step, ::step]
    owners = np.zeros(masks.shape, np.int64)
    for slot, label in enumerate(labels):
        owners[masks == label] = slot + 1
    points = torch.from_numpy(view.points[::step, ::step].astype(np.float32))
    chances = torch.from_numpy(
        random.random((len(eye), len(labels), samples.ends)).astype(np.float32)
    )
    rows = (len(eye), -1, -1)
    return object_ends(
        points.expand(*rows, -1), torch.from_numpy(owners).expand(rows), eye, chances
    )


def _scenes_of(fitted: Sequence[FittedSuperquadric], rows: int) -> SceneParameters:
    """One scene of fitted superquadrics, so many times (rows, N)."""

    def stacked(values: Sequence[Any], *shape: int) -> Tensor:
        tensor = torch.from_numpy(np.array(values, dtype=np.float32).reshape(len(fitted), *shape))
        return tensor.expand(rows, *tensor.shape)

    return SceneParameters(
        stacked([item.half_axes for item in fitted], 3),
        stacked([item.exponents for item in fitted], 3),
        stacked([item.pose.rotation for item in fitted], 3, 3),
        stacked([item.pose.position for item in fitted], 3),
        torch.ones(rows, len(fitted), dtype=torch.bool),
    )
