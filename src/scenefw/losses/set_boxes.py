"""Loss of the boxes that predicted objects are put into."""

import torch
from torch import Tensor

from scenefw.core.errors import InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup
from scenefw.losses.set_targets import matched_of, require_given


class SetBoxes:
    """Mean distance of the faces of predicted boxes from those of the matched objects.

    Args:
        weight: factor of this term in the total.
    """

    needs_draws = False

    def __init__(self, weight: float = 3e-2) -> None:
        self.weight = weight

    def check(self, setup: ObjectSetSetup) -> None:
        """Raises a ConfigError if the network predicts no boxes."""
        require_given("set_boxes", "boxes", setup)

    def __call__(self, prediction: ObjectSetPrediction, batch: ObjectSetBatch) -> Tensor:
        """A scalar in half sides of the grid, the mean over matched predictions; 0 without any.

        Raises:
            InputError: predictions are not matched, or have no boxes.
        """
        if prediction.boxes is None:
            raise InputError("the network gives no boxes; choose model=set_placed")
        matched = matched_of(prediction)
        true = boxes_of(batch.instances, batch.present.shape[1])
        objects = matched.clamp(min=0)[..., None, None].expand(-1, -1, 2, 3)
        centres, halves = prediction.boxes.float().unbind(dim=-2)
        faces = torch.stack([centres - halves, centres + halves], dim=-2)
        errors = (faces - true.gather(1, objects)).abs().mean(dim=(-2, -1))
        weights = (matched >= 0).to(errors.dtype)
        return (errors * weights).sum() / weights.sum().clamp(min=1)


@torch.no_grad()
def boxes_of(instances: Tensor, count: int) -> Tensor:
    """Faces of the smallest boxes around the voxels of objects.

    Args:
        instances: (B, X, Y, Z) labels, 0 = no object, i + 1 = object i.
        count: objects at most, M.

    Returns:
        (B, M, 2, 3) lower and upper faces in the cube of the grid, from -1 to 1; objects without a
        voxel have the faces of the cube, upper before lower.
    """
    batch, side = len(instances), instances.shape[-1]
    where = (instances > 0).nonzero()
    rows = where[:, 0] * count + instances[tuple(where.T)].long() - 1
    voxels = where[:, 1:].float()
    rows = rows[:, None].expand(-1, 3)
    start = voxels.new_full((batch * count, 3), float(side))
    lower = start.scatter_reduce(0, rows, voxels, "amin")
    upper = torch.zeros_like(start).scatter_reduce(0, rows, voxels + 1, "amax")
    faces = torch.stack([lower, upper], dim=1) * (2 / side) - 1
    return faces.view(batch, count, 2, 3)
