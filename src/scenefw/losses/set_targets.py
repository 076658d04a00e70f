"""What losses of sets have in common: matched predictions, and checks before the work."""

import torch
from torch import Tensor

from scenefw.core.errors import ConfigError, InputError
from scenefw.core.object_sets import ObjectSetBatch, ObjectSetPrediction, ObjectSetSetup

_TURNED_ON = {
    "existence": "model.existence=true",
    "centres": "model.centres=true",
    "boxes": "model=set_placed",
    "partial": "model=set_vae",
    "latent": "model=set_vae",
    "divergence": "model=set_placed_vae",
}


def matched_of(prediction: ObjectSetPrediction) -> Tensor:
    """The object (B, N) int64 of each prediction, -1 = none.

    Raises:
        InputError: they are not matched.
    """
    if prediction.matched is None:
        raise InputError("match predictions to objects before the loss (matching.object_sets)")
    return prediction.matched


def object_sums(values: Tensor, matched: Tensor, batch: ObjectSetBatch) -> tuple[Tensor, Tensor]:
    """Sums of each prediction's values over the voxels of its own object, and how many these are.

    Only occupied voxels are looked at, a few per cent of a grid.

    Args:
        values: (B, N, X, Y, Z).
        matched: (B, N) int64, the object of each prediction, -1 = none.
        batch: with the voxels of objects.

    Returns:
        Both (B, N); 0 for predictions without an object.
    """
    rows, slots = matched.shape
    slot_of = matched.new_full((rows, batch.present.shape[1] + 2), slots)
    slot_of.scatter_(1, matched + 2, torch.arange(slots, device=matched.device).expand(rows, -1))
    slot_of[:, :2] = slots  # no object, and predictions without one
    labels = batch.instances.flatten(1)
    scene, voxel = (labels > 0).nonzero(as_tuple=True)
    slot = slot_of[scene, labels[scene, voxel].long() + 1]
    is_matched = slot < slots
    scene, voxel, slot = scene[is_matched], voxel[is_matched], slot[is_matched]
    inside = values.flatten(2)[scene, slot, voxel].float()
    into = scene * slots + slot
    sums = inside.new_zeros(rows * slots).index_add(0, into, inside)
    counts = torch.bincount(into, minlength=rows * slots).to(sums.dtype)
    return sums.view(rows, slots), counts.view(rows, slots)


def require_given(loss: str, name: str, setup: ObjectSetSetup) -> None:
    """Whether the network predicts what a loss compares.

    Raises:
        ConfigError: it doesn't.
    """
    if name not in setup.gives:
        raise ConfigError(
            f"the loss {loss} needs a network that gives its {name}; choose {_TURNED_ON[name]}, or "
            "leave the loss out"
        )
