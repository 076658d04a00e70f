"""Which true object each predicted occupancy stands for, by binary cross entropy."""

import torch
from torch import Tensor

from scenefw.core.protocols import Matching
from scenefw.matching.assignment import Assignment

_APART = 10.0  # logits per half side of the grid


def sums_inside(logits: Tensor, instances: Tensor, count: int) -> Tensor:
    """Sums of the logits X of each prediction over the voxels of each true object, X T^t.

    Only occupied voxels are looked at, a few per cent of a grid, and never a volume per pair.

    Args:
        logits: (B, N, X, Y, Z).
        instances: (B, X, Y, Z) labels, 0 = no object, i + 1 = object i.
        count: objects at most, M.

    Returns:
        (B, N, M) float32; 0 for objects without a voxel.
    """
    batch, slots = logits.shape[:2]
    labels = instances.flatten(1)
    scene, voxel = (labels > 0).nonzero(as_tuple=True)
    values = logits.flatten(2)[scene, :, voxel].float()
    rows = scene * count + labels[scene, voxel].long() - 1
    sums = values.new_zeros(batch * count, slots).index_add_(0, rows, values)
    return sums.view(batch, count, slots).transpose(1, 2)


@torch.no_grad()
def matched_objects(
    logits: Tensor,
    instances: Tensor,
    present: Tensor,
    matching: Matching | None = None,
    centre_distances: Tensor | None = None,
) -> Tensor:
    """The object that each prediction is trained towards, -1 = none, so that it learns to be empty.

    The assignment has the least binary cross entropy, summed over all predictions, those without an
    object against an empty grid (thesis fig. 6.5; its text says the greatest). BCE of logits is
    sum softplus(x) - X T^t, and every prediction has one target, so the first term is the same
    whatever is assigned: the second alone decides.

    Args:
        logits: (B, N, X, Y, Z).
        instances: (B, X, Y, Z) labels, 0 = no object, i + 1 = object i.
        present: (B, M) bool, which objects there are.
        matching: default is the optimal assignment.
        centre_distances: (B, N, M) of predicted centres from true ones, in half sides of the grid;
            each counts as 10 logits in every voxel of the object. None: shapes alone decide.

    Returns:
        (B, N) int64.
    """
    slots = logits.shape[1]
    gains = sums_inside(logits, instances, present.shape[1])
    if centre_distances is not None:
        unit_logits = torch.ones_like(logits[:, :1])
        gains = gains - _APART * centre_distances * sums_inside(
            unit_logits, instances, present.shape[1]
        )
    gains = gains.cpu()
    gains = gains.nan_to_num(posinf=1e30, neginf=-1e30)  # a training that diverged says so itself
    matched = torch.full(logits.shape[:2], -1)
    matching = matching or Assignment()
    for scene, object_mask in enumerate(present.cpu()):
        objects = object_mask.nonzero()[:, 0]
        costs = torch.zeros(slots, max(slots, len(objects)))  # an empty target costs nothing
        costs[:, : len(objects)] = -gains[scene][:, objects]
        for row, column in matching.assign(costs.double().numpy()).tolist():
            if column < len(objects):
                matched[scene, row] = objects[column]
    return matched.to(logits.device)
